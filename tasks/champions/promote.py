"""Changing champions by hand: approve a challenger, or go back to the champion before."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from storage.places.data_folder import MARK, DataFolder
from storage.places.mirror import fetch, local_place
from tasks.registry.champion_registry import (
    AWAITING,
    CHALLENGER,
    PREFIX,
    PROMOTED,
    ROLLED_BACK,
    Registry,
    Version,
)
from tasks.settings.run_settings import RunError


def promote(registry: Registry, challenger: Version) -> None:
    """Make a judged challenger the champion, if the one it was judged against still is.

    RunError: another is.
    """
    champion = registry.aliased(challenger.name)
    against = challenger.tag("against")
    if champion is not None and champion.number == challenger.number:
        return
    if champion is None or str(champion.number) != against:
        now = f"version {champion.number}" if champion else "none"
        raise RunError(
            f"{challenger.name} version {challenger.number} was judged against version {against}, but the "
            f"champion is {now} now and stays; it is judged anew once more is learned."
        )
    registry.tagged(challenger, {"previous": champion.number})
    registry.point(challenger)


def promote_awaiting(data: Path, memory: str | None) -> None:
    """Promote what awaits approval: of one memory, or all there is. RunError: nothing does."""
    registry = _registry(data)
    found = [registry.aliased(name, CHALLENGER) for name in _names(registry, memory)]
    awaiting = [each for each in found if each is not None and each.tag("verdict") in (AWAITING, PROMOTED)]
    if not awaiting:
        raise RunError(f"{_of(memory)} no challenger awaits approval; `retrain --approve` leaves one.")
    for challenger in awaiting:
        promote(registry, challenger)
        registry.tagged(challenger, {"verdict": PROMOTED})
        registry.drop(challenger.name, CHALLENGER)
        print(f"{challenger.name}: version {challenger.number} is champion, was {challenger.tag('against')}")


def roll_back(data: Path, memory: str | None) -> None:
    """Point the alias at the champion before: of one memory, or of all that the last retraining promoted.

    RunError: there was none before.
    """
    registry = _registry(data)
    found = [registry.aliased(name) for name in _names(registry, memory)]
    champions = [each for each in found if each is not None and each.tag("previous")]
    if not champions:
        raise RunError(f"{_of(memory)} no champion has one before it: nothing to roll back to.")
    last = max(each.retraining for each in champions)
    for champion in champions:
        if memory is None and champion.retraining != last:
            continue
        before = next(
            (
                each
                for each in registry.versions(champion.name)
                if str(each.number) == champion.tag("previous")
            ),
            None,
        )
        if before is None:
            raise RunError(
                f"{champion.name}: version {champion.tag('previous')}, the champion before, is not in the "
                f"registry any more; version {champion.number} stays."
            )
        registry.tagged(champion, {"verdict": ROLLED_BACK})
        registry.point(before)  # last: who is killed before it goes back by one when told again, not by two
        print(f"{champion.name}: version {before.number} is champion again, was {champion.number}")


def _registry(data: Path) -> Registry:
    folder = local_place(data).expanduser().absolute()
    if not fetch(folder / MARK).is_file():
        raise RunError(f"{data} is no data folder: it has no {MARK}.")
    return Registry(DataFolder(folder))


def _names(registry: Registry, memory: str | None) -> Sequence[str]:
    """The names that are meant: all, or those of one memory, which may be given as in the registry."""
    known = registry.names()
    if memory is None:
        return known
    named = [name for name in known if name in (memory, PREFIX + memory)]
    if not named:
        raise RunError(f"No memory {memory!r} in the registry. Known: {', '.join(known) or 'none'}.")
    return named


def _of(memory: str | None) -> str:
    return "In the registry" if memory is None else f"Of {memory}"
