"use strict";
// The vehicle drives the plan; a line in the charts of speed and steering goes with it.
const SVG = "http://www.w3.org/2000/svg";
const source = document.getElementById("drive");
if (source) {
  const { dt, bodies } = JSON.parse(source.textContent);
  const moving = document.querySelector("#chart-world .moving");
  const time = document.getElementById("time"), clock = document.getElementById("clock"), play = document.getElementById("play");
  const cursors = document.querySelectorAll(".cursor");
  const shapes = [];
  for (let i = 0; i < bodies[0].length; i += 1) {
    shapes.push(moving.appendChild(document.createElementNS(SVG, "polygon")));
  }
  const show = (step) => {
    bodies[step].forEach((corners, i) => shapes[i].setAttribute("points", corners.map((value) => value / 100).join(" ")));
    const seconds = step * dt;
    time.value = step;
    clock.textContent = `${seconds.toFixed(1)} s`;
    time.setAttribute("aria-valuetext", clock.textContent);
    for (const cursor of cursors) {
      const { first, last, low, high } = cursor.dataset;
      const x = +first + (+last - +first) * (seconds - +low) / (+high - +low);
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
    }
  };
  let began = null;
  const stop = () => { began = null; play.setAttribute("aria-pressed", "false"); play.textContent = "Drive"; };
  const SPEED = 4; // times as fast as the vehicle would
  const frame = (now) => {
    if (began === null) return;
    const step = Math.floor((SPEED * (now - began)) / 1000 / dt);
    show(Math.max(0, Math.min(step, bodies.length - 1))); // a frame's time may lie before the click
    if (step < bodies.length - 1) requestAnimationFrame(frame); else stop();
  };
  play.addEventListener("click", () => {
    if (began !== null) { stop(); return; }
    const from = +time.value >= bodies.length - 1 ? 0 : +time.value;
    began = performance.now() - (1000 * dt * from) / SPEED;
    play.setAttribute("aria-pressed", "true");
    play.textContent = "Pause";
    requestAnimationFrame(frame);
  });
  time.addEventListener("input", () => { stop(); show(+time.value); });
  show(0);
}
// One recalled plan alone.
const recalled = document.querySelectorAll(".recalled");
for (const button of document.querySelectorAll(".only")) {
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-pressed") !== "true";
    for (const each of document.querySelectorAll(".only")) each.setAttribute("aria-pressed", "false");
    button.setAttribute("aria-pressed", String(on));
    for (const plan of recalled) plan.classList.toggle("dimmed", on && plan.dataset.order !== button.dataset.only);
  });
}
