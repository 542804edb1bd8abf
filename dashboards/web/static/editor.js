"use strict";
// A world that can be edited. After each change it is planned in again, with and without memory.
const SVG = "http://www.w3.org/2000/svg";
const svg = document.getElementById("editor");
const given = JSON.parse(document.getElementById("start-world").textContent);
const choices = document.getElementById("choices");
let world = given.world, outline = given.start, chosen = -1, answers = [], past = [], requests = 0, timer = null;

const make = (name, attributes, parent) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return parent ? parent.appendChild(made) : made;
};
const written = (points) => points.map(([x, y]) => `${x},${y}`).join(" ");

// Polygons that were pieces of one obstacle stay together: groups of polygons, as the file says.
let things = [];
const take = (fields) => {
  world = fields;
  const sizes = fields.groups ?? fields.obstacles.map(() => 1);
  things = [];
  let at = 0;
  for (const size of sizes) { things.push(fields.obstacles.slice(at, at + size)); at += size; }
  chosen = -1;
};
const fields = () => {
  const { groups, ...rest } = world;
  const round = (value) => Math.round(value * 1000) / 1000;
  const made = { ...rest, obstacles: things.flat().map((polygon) => polygon.map(([x, y]) => [round(x), round(y)])) };
  if (things.some((thing) => thing.length > 1)) made.groups = things.map((thing) => thing.length);
  return made;
};
const centre = (thing) => {
  const every = thing.flat();
  return [0, 1].map((i) => (Math.min(...every.map((point) => point[i])) + Math.max(...every.map((point) => point[i]))) / 2);
};
const moved = (thing, dx, dy) => thing.map((polygon) => polygon.map(([x, y]) => [x + dx, y + dy]));
const turned = (thing, angle) => {
  const [cx, cy] = centre(thing), cos = Math.cos(angle), sin = Math.sin(angle);
  return thing.map((polygon) => polygon.map(([x, y]) => [cx + cos * (x - cx) - sin * (y - cy), cy + sin * (x - cx) + cos * (y - cy)]));
};

const draw = (focus = false) => {
  const [xMin, yMin, xMax, yMax] = world.bounds, margin = (xMax - xMin) / 64;
  svg.setAttribute("viewBox", `${xMin - margin} ${-yMax - margin} ${xMax - xMin + 2 * margin} ${yMax - yMin + 2 * margin}`);
  svg.replaceChildren();
  const flipped = make("g", { transform: "scale(1 -1)" }, svg);
  make("rect", { x: xMin, y: yMin, width: xMax - xMin, height: yMax - yMin, class: "bounds" }, flipped);
  make("circle", { cx: world.goal[0], cy: world.goal[1], r: world.goal_radius ?? world.goal_tolerance?.[0] ?? 2, class: "goal" }, flipped);
  things.forEach((thing, i) => {
    const group = make("g", { class: `obstacle${i === chosen ? " chosen" : ""}`, "data-thing": i }, flipped);
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
    make("polyline", { points: written(answer.way), class: alone ? "alone-plan" : "with-plan" }, flipped);
  }
  const start = make("g", { class: "start" }, flipped);
  for (const body of outline) make("polygon", { points: written(body) }, start);
  const [x, y, heading] = world.start;
  make("line", { x1: x, y1: y, x2: x + 4.5 * Math.cos(heading), y2: y + 4.5 * Math.sin(heading), class: "heading" }, flipped);
  if (chosen >= 0) {
    const [cx, cy] = centre(things[chosen]);
    const high = Math.max(...things[chosen].flat().map((point) => point[1])) + 2.5;
    make("line", { x1: cx, y1: cy, x2: cx, y2: high, class: "stem" }, flipped);
    make("circle", { cx, cy: high, r: 1.1, class: "handle" }, flipped);
  }
  for (const id of ["turn", "remove"]) document.getElementById(id).disabled = chosen < 0;
  document.getElementById("undo").disabled = !past.length;
  if (focus) svg.focus();
};

const say = (text) => { document.getElementById("said").textContent = text; };
const remember = () => { past.push(JSON.stringify(things)); if (past.length > 100) past.shift(); };
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
  for (const [name, fact] of facts) {
    list.append(Object.assign(document.createElement("dt"), { textContent: name }), Object.assign(document.createElement("dd"), { textContent: fact }));
  }
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
      const ratio = alone.ms / withMemory.ms;
      say(ratio >= 1 ? `With memory ${ratio.toFixed(1)} times as fast.` : `With memory ${(1 / ratio).toFixed(1)} times as long.`);
    } else say(withMemory?.solved ? "Only with memory is a plan found." : alone.solved ? "A plan is found without memory." : "No plan is found in time.");
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
  const handle = event.target.closest(".handle"), thing = event.target.closest(".obstacle");
  const was = chosen;
  if (!handle) chosen = thing ? +thing.dataset.thing : -1;
  if (chosen >= 0 && (handle || thing)) {
    drag = { from: at(event), thing: things[chosen], turning: Boolean(handle), begun: false };
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  }
  if (was !== chosen || handle) draw(true); else svg.focus();
});
svg.addEventListener("pointermove", (event) => {
  if (!drag) return;
  const [x, y] = at(event);
  if (!drag.begun) { remember(); drag.begun = true; }
  if (drag.turning) {
    const [cx, cy] = centre(drag.thing);
    things[chosen] = turned(drag.thing, Math.atan2(y - cy, x - cx) - Math.atan2(drag.from[1] - cy, drag.from[0] - cx));
  } else things[chosen] = moved(drag.thing, x - drag.from[0], y - drag.from[1]);
  changed();
});
for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { drag = null; });

const edit = (change) => { if (chosen < 0) return; remember(); things[chosen] = change(things[chosen]); changed(); };
const remove = () => { if (chosen < 0) return; remember(); things.splice(chosen, 1); chosen = -1; changed(); };
const undo = () => { if (!past.length) return; things = JSON.parse(past.pop()); chosen = -1; changed(); };
svg.addEventListener("keydown", (event) => {
  const step = event.shiftKey ? 0.1 : 1;
  const way = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
  if (event.key === "z" && (event.ctrlKey || event.metaKey)) undo();
  else if (event.key === "Tab" && things.length) {
    const next = chosen + (event.shiftKey ? -1 : 1);
    if (next < 0 || next >= things.length) { chosen = -1; draw(); return; } // on to the next element of the page
    chosen = next;
    draw();
  } else if (event.key === "Escape") { chosen = -1; draw(); }
  else if (chosen < 0) return;
  else if (way) edit((thing) => moved(thing, ...way));
  else if (event.key === "[" || event.key === "]") edit((thing) => turned(thing, (event.key === "[" ? 1 : -1) * Math.PI / 12));
  else if (event.key === "Delete" || event.key === "Backspace") remove();
  else return;
  event.preventDefault();
});
document.getElementById("remove").addEventListener("click", remove);
document.getElementById("turn").addEventListener("click", () => edit((thing) => turned(thing, Math.PI / 12)));
document.getElementById("undo").addEventListener("click", undo);
document.getElementById("clear").addEventListener("click", () => { remember(); things = []; chosen = -1; changed(); });
for (const button of document.querySelectorAll("[data-add]")) {
  button.addEventListener("click", () => {
    if (things.length >= given.limits.obstacles) { say(`At most ${given.limits.obstacles} obstacles.`); return; }
    remember();
    const corners = +button.dataset.add, [xMin, yMin, xMax, yMax] = world.bounds;
    const cx = (xMin + xMax) / 2 + 4 * ((things.length % 3) - 1), cy = (yMin + yMax) / 2 + 4 * ((things.length % 2) - 0.5);
    const turn = Math.PI / corners;
    things.push([Array.from({ length: corners }, (_, i) => [cx + 3 * Math.cos(turn + (2 * Math.PI * i) / corners), cy + 3 * Math.sin(turn + (2 * Math.PI * i) / corners)])]);
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
