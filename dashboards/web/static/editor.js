"use strict";
// A world that can be edited. After each change it is planned in again, with and without memory.
const NONE = -1; // what is chosen: an obstacle by its number, or after the last of them the vehicle, then the goal
const svg = document.getElementById("editor");
const given = JSON.parse(document.getElementById("start-world").textContent);
const choices = document.getElementById("choices");
const TURN = Math.PI / 12; // at a press of a key or a button
let world = given.world, outline = given.start, chosen = NONE, answers = [], past = [], requests = 0, timer = null;

// Polygons that were pieces of one obstacle stay together: groups of polygons, as the file says.
let things = [];
const take = (fields) => {
  world = fields;
  const sizes = fields.groups ?? fields.obstacles.map(() => 1);
  things = [];
  let at = 0;
  for (const size of sizes) { things.push(fields.obstacles.slice(at, at + size)); at += size; }
  chosen = NONE;
};
const vehicleItem = () => things.length, goalItem = () => things.length + 1;
const isPose = () => world.goal.length === 3;
const fields = () => {
  const { groups, ...rest } = world;
  const made = { ...rest, obstacles: things.flat() };
  if (things.some((thing) => thing.length > 1)) made.groups = things.map((thing) => thing.length);
  return made;
};
// The vehicle as it would stand at a goal pose, bent as at the start.
const outlineAtGoal = () => {
  const [x, y, heading] = world.start;
  return moved(turned(outline, world.goal[2] - heading, [x, y]), world.goal[0] - x, world.goal[1] - y);
};
const pivot = (item) => (item < things.length ? centre(things[item]) : item === vehicleItem() ? world.start : world.goal);
const around = (item) => (item < things.length ? things[item] : item === vehicleItem() ? outline : outlineAtGoal());
const turns = (item) => item !== NONE && (item < goalItem() || isPose());
const change = (item, dx, dy, angle) => {
  if (item < things.length) things[item] = rounded(moved(turned(things[item], angle, centre(things[item])), dx, dy));
  else if (item === goalItem()) world = { ...world, goal: placed(world.goal, dx, dy, angle) };
  else {
    outline = moved(turned(outline, angle, world.start), dx, dy);
    world = { ...world, start: placed(world.start, dx, dy, angle) };
  }
};
const kept = () => ({ things: [...things], world, outline });
const put = (state) => { things = [...state.things]; ({ world, outline } = state); };

const draw = (focus = false) => {
  const [xMin, yMin, xMax, yMax] = world.bounds, margin = (xMax - xMin) / 64;
  svg.setAttribute("viewBox", `${xMin - margin} ${-yMax - margin} ${xMax - xMin + 2 * margin} ${yMax - yMin + 2 * margin}`);
  svg.style.setProperty("--unit", (xMax - xMin) / 64); // lines look as wide in a small world
  svg.replaceChildren();
  const flipped = make("g", { transform: "scale(1 -1)" }, svg);
  make("rect", { x: xMin, y: yMin, width: xMax - xMin, height: yMax - yMin, class: "bounds" }, flipped);
  const item = (index, name, parent) => make("g", { class: `item ${name}${index === chosen ? " chosen" : ""}`, "data-item": index }, parent);
  const reach = 1.4 * Math.max(...outline.flat().map(([x, y]) => Math.hypot(x - world.start[0], y - world.start[1])));
  const pointing = ([x, y, heading], parent, name) => {
    make("line", { x1: x, y1: y, x2: x + reach * Math.cos(heading), y2: y + reach * Math.sin(heading), class: `heading ${name}` }, parent);
  };
  if (!isPose()) make("circle", { cx: world.goal[0], cy: world.goal[1], r: world.goal_radius ?? 2, class: "goal" }, item(goalItem(), "place", flipped));
  things.forEach((thing, i) => {
    const group = item(i, "obstacle", flipped);
    for (const polygon of thing) make("polygon", { points: written(polygon) }, group);
  });
  const far = 99, inner = `M${xMin} ${yMin}H${xMax}V${yMax}H${xMin}Z`;
  make("path", { d: `M${xMin - far} ${yMin - far}H${xMax + far}V${yMax + far}H${xMin - far}Z${inner}`, class: "beyond" }, flipped);
  make("rect", { x: xMin, y: yMin, width: xMax - xMin, height: yMax - yMin, class: "frame" }, flipped);
  for (const answer of answers) {
    if (!answer.way.length) continue;
    const alone = answer.assist === "none";
    if (!alone) {
      const bodies = make("g", { class: "bodies" }, flipped);
      for (const body of answer.bodies) make("polygon", { points: written(body) }, bodies);
    }
    const of = alone ? "alone-plan" : "with-plan";
    make("polyline", { points: written(answer.way), class: of }, flipped);
    for (const piece of answer.backwards) make("polyline", { points: written(piece), class: "backwards" }, flipped);
    for (const [cx, cy] of answer.cusps) make("circle", { cx, cy, r: (xMax - xMin) / 110, class: `cusp ${of}` }, flipped);
  }
  if (isPose()) {
    const goal = item(goalItem(), "pose", flipped);
    for (const body of outlineAtGoal()) make("polygon", { points: written(body) }, goal);
    pointing(world.goal, goal, "asked");
  }
  const start = item(vehicleItem(), "start", flipped);
  for (const body of outline) make("polygon", { points: written(body) }, start);
  pointing(world.start, start, "");
  if (turns(chosen)) {
    const [cx, cy] = pivot(chosen), size = (xMax - xMin) / 58;
    const high = Math.max(...around(chosen).flat().map((point) => point[1])) + 2.3 * size;
    make("line", { x1: cx, y1: cy, x2: cx, y2: high, class: "stem" }, flipped);
    make("circle", { cx, cy: high, r: size, class: "handle" }, flipped);
  }
  document.getElementById("turn").disabled = !turns(chosen);
  document.getElementById("remove").disabled = chosen === NONE || chosen >= things.length;
  document.getElementById("arrive").textContent = isPose() ? "Goal: a pose" : "Goal: a place";
  document.getElementById("arrive").setAttribute("aria-pressed", String(isPose()));
  document.getElementById("undo").disabled = !past.length;
  if (focus) svg.focus();
};

const say = (text) => { document.getElementById("said").textContent = text; };
const remember = () => { past.push(kept()); if (past.length > 100) past.shift(); };
const value = (name) => choices.elements[name]?.value ?? "";
const number = (value, decimals) => value.toLocaleString("en", { minimumFractionDigits: decimals, maximumFractionDigits: decimals });
const tell = (where, answer) => {
  document.getElementById(`ms-${where}`).textContent = answer ? (answer.solved ? `${number(answer.ms, 2)} ms` : "no plan") : "–";
  const list = document.getElementById(`facts-${where}`);
  list.replaceChildren();
  if (!answer) return;
  const facts = [["ended", answer.ended], ["checks", number(answer.checks, 0)], ["nodes", number(answer.nodes, 0)]];
  if (!answer.solved) facts.push(["took", `${number(answer.ms, 1)} ms`]);
  if (answer.length_m !== null) facts.push(["length", `${number(answer.length_m, 1)} m`], ["duration", `${number(answer.duration_s, 1)} s`]);
  if (answer.cusps.length) facts.push(["changes of gear", number(answer.cusps.length, 0)]);
  for (const [name, fact] of facts) {
    list.append(Object.assign(document.createElement("dt"), { textContent: name }), Object.assign(document.createElement("dd"), { textContent: fact }));
  }
};

const compared = (alone, withMemory) => {
  const faster = alone.ms / withMemory.ms, sooner = alone.duration_s - withMemory.duration_s;
  const same = alone.ended === withMemory.ended && alone.nodes === withMemory.nodes && alone.length_m === withMemory.length_m;
  if (same) return "The memory has no plan that helps here: both searched, and times differ by chance.";
  const planned = Math.max(faster, 1 / faster).toFixed(1), driven = Math.abs(sooner).toFixed(1);
  const time = planned === "1.0" ? "Planned as fast with memory" : `Planned ${planned} times as ${faster > 1 ? "fast" : "long"} with memory`;
  return driven === "0.0" ? `${time}.` : `${time}; the drive is ${driven} s ${sooner > 0 ? "shorter" : "longer"}.`;
};
const post = async (where, content) => {
  const base = location.pathname.replace(/\/try$/, "");
  const response = await fetch(`${base}/${where}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) });
  const answer = await response.json();
  if (!response.ok) throw new Error(answer.error ?? "This cannot be answered.");
  return answer;
};
const plan = async () => {
  const mine = ++requests, began = performance.now();
  try {
    const planned = await post("plan", { world: fields(), planner: value("planner"), assist: value("assist"), memory: value("memory") });
    if (mine !== requests) return;
    answers = planned.answers;
    const [alone, withMemory] = answers;
    tell("alone", alone);
    tell("with", withMemory);
    if (withMemory?.solved && alone.solved) {
      say(compared(alone, withMemory));
    } else say(withMemory?.solved ? "Only with memory is a plan found." : alone.solved ? "A plan is found without memory." : "No plan is found within the limits of this page.");
  } catch (error) {
    if (mine !== requests) return;
    answers = [];
    tell("alone");
    tell("with");
    say(error.message);
  }
  svg.dataset.planned = String(mine);
  svg.dataset.took = (performance.now() - began).toFixed(0);
  draw();
};
const state = () => `#w=${btoa(String.fromCharCode(...new TextEncoder().encode(JSON.stringify(fields())))).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
const changed = () => {
  clearTimeout(timer);
  timer = setTimeout(() => { history.replaceState(null, "", state()); plan(); }, 120);
  draw();
};

const at = (event) => {
  const box = svg.getScreenCTM().inverse();
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(box);
  return [point.x, -point.y];
};
let drag = null;
svg.addEventListener("pointerdown", (event) => {
  const handle = event.target.closest(".handle"), item = event.target.closest(".item");
  const was = chosen;
  if (!handle) chosen = item ? +item.dataset.item : NONE;
  if (handle || item) {
    drag = { from: at(event), before: kept(), turning: Boolean(handle), begun: false };
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  }
  if (was !== chosen || handle) draw(true); else svg.focus();
});
svg.addEventListener("pointermove", (event) => {
  if (!drag) return;
  const [x, y] = at(event);
  if (!drag.begun) { remember(); drag.begun = true; }
  put(drag.before);
  if (drag.turning) {
    const [cx, cy] = pivot(chosen);
    change(chosen, 0, 0, Math.atan2(y - cy, x - cx) - Math.atan2(drag.from[1] - cy, drag.from[0] - cx));
  } else change(chosen, x - drag.from[0], y - drag.from[1], 0);
  changed();
});
for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { drag = null; });

const edit = (dx, dy, angle) => { if (chosen === NONE || (angle && !turns(chosen))) return; remember(); change(chosen, dx, dy, angle); changed(); };
const remove = () => { if (chosen === NONE || chosen >= things.length) return; remember(); things.splice(chosen, 1); chosen = NONE; changed(); };
const undo = () => { if (!past.length) return; put(past.pop()); chosen = NONE; changed(); };
const arrive = () => { // at a pose instead of a place, or the other way round
  remember();
  const { goal_radius, goal_tolerance, goal_speed, goal_hitch, goal_hitch_tolerance, ...rest } = world;
  const [x, y] = world.goal;
  world = { ...rest, goal: isPose() ? [x, y] : [x, y, world.start[2]] };
  chosen = goalItem();
  changed();
};
svg.addEventListener("keydown", (event) => {
  const step = event.shiftKey ? 0.1 : 1;
  const way = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
  if (event.key === "z" && (event.ctrlKey || event.metaKey)) undo();
  else if (event.key === "Tab") {
    const next = chosen + (event.shiftKey ? -1 : 1);
    if (next < 0 || next > goalItem()) { chosen = NONE; draw(); return; } // on to the next element of the page
    chosen = next;
    draw();
  } else if (event.key === "Escape") { chosen = NONE; draw(); }
  else if (chosen === NONE) return;
  else if (way) edit(...way, 0);
  else if (event.key === "[" || event.key === "]") edit(0, 0, (event.key === "[" ? 1 : -1) * TURN);
  else if (event.key === "Delete" || event.key === "Backspace") remove();
  else return;
  event.preventDefault();
});
document.getElementById("remove").addEventListener("click", remove);
document.getElementById("turn").addEventListener("click", () => edit(0, 0, TURN));
document.getElementById("arrive").addEventListener("click", arrive);
document.getElementById("undo").addEventListener("click", undo);
document.getElementById("clear").addEventListener("click", () => { remember(); things = []; chosen = NONE; changed(); });
for (const button of document.querySelectorAll("[data-add]")) {
  button.addEventListener("click", () => {
    if (things.length >= given.limits.obstacles) { say(`At most ${given.limits.obstacles} obstacles.`); return; }
    remember();
    const corners = +button.dataset.add, [xMin, yMin, xMax, yMax] = world.bounds;
    const cx = (xMin + xMax) / 2 + 4 * ((things.length % 3) - 1), cy = (yMin + yMax) / 2 + 4 * ((things.length % 2) - 0.5);
    const turn = Math.PI / corners;
    things.push(rounded([Array.from({ length: corners }, (_, i) => [cx + 3 * Math.cos(turn + (2 * Math.PI * i) / corners), cy + 3 * Math.sin(turn + (2 * Math.PI * i) / corners)])]));
    chosen = things.length - 1;
    changed();
  });
}
document.getElementById("file").addEventListener("change", async (event) => {
  const file = event.target.files[0];
  event.target.value = "";
  if (!file) return;
  try {
    if (file.size > 1 << 20) throw new Error("A world takes at most 1 MB; this file is larger.");
    let content;
    try { content = JSON.parse(await file.text()); } catch { throw new Error(`${file.name} is no JSON.`); }
    const checked = await post("check", content);
    remember();
    outline = checked.start;
    take(checked.world);
    changed();
  } catch (error) { say(error.message); }
});
document.getElementById("save").addEventListener("click", () => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([`${JSON.stringify(fields())}\n`], { type: "application/json" }));
  link.download = "problem.json";
  link.click();
});
document.getElementById("copy").addEventListener("click", async () => {
  history.replaceState(null, "", state());
  try { await navigator.clipboard.writeText(location.href); say("The link is copied; it opens this world again."); } catch { say("The address of this page opens this world again."); }
});
for (const select of choices.querySelectorAll("select")) {
  select.addEventListener("change", () => {
    const address = new URL(location.href);
    address.searchParams.set(select.name, select.value);
    if (select.name === "class") { address.searchParams.delete("problem"); address.hash = ""; location.assign(address); return; }
    history.replaceState(null, "", address);
    plan();
  });
}
choices.addEventListener("submit", (event) => event.preventDefault());

const begin = async () => {
  take(given.world);
  const kept = /^#w=([\w-]+)$/.exec(location.hash);
  if (kept) {
    try {
      const bytes = Uint8Array.from(atob(kept[1].replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
      const checked = await post("check", JSON.parse(new TextDecoder().decode(bytes)));
      outline = checked.start;
      take(checked.world);
    } catch (error) { say(`The world in this address cannot be read: ${error.message}`); draw(); return; }
  }
  draw();
  plan();
};
begin();
