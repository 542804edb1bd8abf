"""Change champions: make a judged challenger champion, or return to the previous champion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from storage.places.data_folder import MARK, DataFolder
from storage.places.mirror import fetch, local_place
from tasks.registry.champion_registry import (
    AWAITING,
    CHALLENGER,
    PROMOTED,
    ROLLED_BACK,
    Registry,
    Version,
)
from tasks.settings.errors import RunError
from tasks.tracking.model_names import PREFIX


class ChangedChampionError(RunError):
    """The champion is no longer the version that a challenger was judged against."""


class ChampionChange(NamedTuple):
    """A memory whose champion has changed."""

    name: str  # in the registry
    before: int  # number of the version that was champion
    now: int


def promote(registry: Registry, challenger: Version) -> None:
    """Make a judged challenger the champion.

    Raises ChangedChampionError if the champion is no longer the version that it was judged against.
    """
    champion = registry.aliased(challenger.name)
    against = challenger.tag("against")
    if champion is not None and champion.number == challenger.number:
        return
    if champion is None or str(champion.number) != against:
        now = f"version {champion.number}" if champion else "none"
        raise ChangedChampionError(
            f"{challenger.name} version {challenger.number} was judged against version {against}, but the "
            f"champion is {now} now and stays; the next retraining judges again."
        )
    registry.set_tags(challenger, {"previous": champion.number})
    registry.set_alias(challenger)


def promote_awaiting(data: Path, memory: str | None) -> list[ChampionChange]:
    """Promote the challengers that await approval; those whose champion has changed are told at the end.

    Args:
        data: the data folder.
        memory: the memory whose challenger is promoted; None promotes those of all memories.

    Returns:
        the changes of champions.

    Raises:
        RunError: no challenger awaits approval, or a champion has changed since its challenger was judged;
            the message says which others were promoted.
    """
    registry = _registry(data)
    challengers = [registry.aliased(name, CHALLENGER) for name in _names(registry, memory)]
    awaiting = [
        version
        for version in challengers
        if version is not None and version.tag("verdict") in (AWAITING, PROMOTED)
    ]
    if not awaiting:
        raise RunError(f"No challenger{_of(memory)} awaits approval; `--approve` of a retraining leaves one.")
    changes, faults = [], []
    for challenger in awaiting:
        try:
            promote(registry, challenger)
        except ChangedChampionError as error:
            faults.append(str(error))
            continue
        registry.set_verdict(challenger, PROMOTED)
        registry.remove_alias(challenger.name, CHALLENGER)
        changes.append(ChampionChange(challenger.name, int(challenger.tag("against")), challenger.number))
    if faults:
        promoted = ", ".join(f"{each.name} version {each.now}" for each in changes)
        raise RunError(" ".join([*faults, *([f"Promoted: {promoted}."] if promoted else [])]))
    return changes


def roll_back(data: Path, memory: str | None) -> list[ChampionChange]:
    """Make the previous champion champion again.

    Args:
        data: the data folder.
        memory: the memory or library whose champion changes; None changes the memories that the last
            retraining promoted. A library is retrained alone, so it is only changed by its name.

    Returns:
        the changes of champions.

    Raises:
        RunError: there was no champion before, or its version is no longer in the registry.
    """
    registry = _registry(data)
    current = [registry.aliased(name) for name in _names(registry, memory)]
    champions = [
        version
        for version in current
        if version is not None and version.tag("previous") and not (memory is None and version.is_library)
    ]
    if not champions:
        raise RunError(f"No champion{_of(memory)} has a previous one to roll back to.")
    last = max(champion.retraining for champion in champions)
    found: list[tuple[Version, Version]] = []
    for champion in champions:
        if memory is None and champion.retraining != last:
            continue
        before = next(
            (
                version
                for version in registry.versions(champion.name)
                if str(version.number) == champion.tag("previous")
            ),
            None,
        )
        if before is None:
            raise RunError(
                f"{champion.name}: version {champion.tag('previous')}, the previous champion, is no longer "
                f"in the registry; nothing was changed."
            )
        found.append((champion, before))
    changes = []
    for champion, before in found:
        registry.set_verdict(champion, ROLLED_BACK)
        # last: if the command is killed before this line, repeating it still goes back only one version
        registry.set_alias(before)
        changes.append(ChampionChange(champion.name, champion.number, before.number))
    return changes


def _registry(data: Path) -> Registry:
    folder = local_place(data).expanduser().absolute()
    if not fetch(folder / MARK).is_file():
        raise RunError(f"{data} is not a data folder: it has no {MARK}.")
    return Registry(DataFolder(folder))


def _names(registry: Registry, memory: str | None) -> Sequence[str]:
    """All registered names, or that of one memory, given with or without the registry's prefix.

    The vehicle may be left out of its name where that is no other's.
    """
    names = registry.names()
    if memory is None:
        return names
    matching = [name for name in names if name in (memory, PREFIX + memory)]
    of_vehicles = matching or [name for name in names if name.startswith(f"{PREFIX}{memory}-")]
    if len(of_vehicles) > 1:
        raise RunError(f"Several memories are called {memory!r}; name one of them: {', '.join(of_vehicles)}.")
    if not of_vehicles:
        raise RunError(f"No memory {memory!r} in the registry. Known: {', '.join(names) or 'none'}.")
    return of_vehicles


def _of(memory: str | None) -> str:
    return "" if memory is None else f" of {memory}"
