"use strict";
// Charts zoom: with the buttons, by a double click or tap, with Ctrl and the wheel; then they are dragged.
// A drawing's part in view is its viewBox. Its axes stay at its edges, its marks and letters keep their size.
const STEP = 2, MOST = 32;
for (const chart of document.querySelectorAll("figure.chart")) {
  const zooms = [...chart.querySelectorAll(".drawing > svg")].map(zoomable);
  const controls = chart.querySelector(".zoom");
  if (!zooms.length) continue;
  controls.hidden = false;
  controls.addEventListener("click", (event) => {
    const step = event.target.dataset.zoom;
    if (step) for (const zoom of zooms) step === "0" ? zoom.whole() : zoom.by(STEP ** +step);
  });
}

function zoomable(svg) {
  const { x: left, y: top, width, height } = svg.viewBox.baseVal;
  const isOfRows = !svg.querySelector(".grid, .world"); // whose heights say nothing: they are only stretched
  const texts = [...svg.querySelectorAll("text:not([transform])")].map((text) => {
    const [x, y] = ["x", "y"].map((name) => +text.getAttribute(name));
    const isTick = text.classList.contains("tick"), isMiddle = text.getAttribute("text-anchor") === "middle";
    text.parentNode.append(text); // above the marks
    return { text, x, y, staysAcross: !(isTick && isMiddle), staysUp: isMiddle || !(isTick || text.classList.contains("label")) };
  });
  if (isOfRows) svg.setAttribute("preserveAspectRatio", "none"); // what has a scale keeps its shape
  svg.style.aspectRatio = `${width} / ${height}`; // else the height would follow the part in view
  let times = 1, up = 1, x = left, y = top;
  const show = () => {
    up = isOfRows ? 1 : times;
    x = Math.min(Math.max(x, left), left + width - width / times);
    y = Math.min(Math.max(y, top), top + height - height / up);
    svg.setAttribute("viewBox", `${x} ${y} ${width / times} ${height / up}`);
    svg.style.setProperty("--across", 1 / times);
    svg.style.setProperty("--up", 1 / up);
    svg.classList.toggle("zoomed", times > 1);
    if (times > 1) svg.setAttribute("tabindex", "0");
    else svg.removeAttribute("tabindex");
    for (const each of texts) {
      if (each.staysAcross) each.text.setAttribute("x", x + (each.x - left) / times);
      if (each.staysUp) each.text.setAttribute("y", y + (each.y - top) / up);
    }
  };
  const place = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  const by = (factor, at = { x: x + width / times / 2, y: y + height / up / 2 }) => {
    const wanted = Math.min(Math.max(times * factor, 1), MOST);
    x = at.x - (at.x - x) * times / wanted;
    y = at.y - (at.y - y) * times / wanted;
    times = wanted;
    show();
  };
  svg.addEventListener("dblclick", (event) => { event.preventDefault(); by(STEP, place(event)); });
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    by(STEP ** (-event.deltaY / 200), place(event));
  }, { passive: false });
  svg.addEventListener("keydown", (event) => {
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!move || times === 1) return;
    event.preventDefault();
    event.stopPropagation();
    x += move[0] * width / times / 8;
    y += move[1] * height / up / 8;
    show();
  });
  let held = null, wasDragged = false;
  svg.addEventListener("pointerdown", (event) => { 
    const { clientX, clientY } = event, { x: ofX, y: ofY } = place(event);
    wasDragged = false;
    held = times > 1 ? { clientX, clientY, x: ofX, y: ofY } : null;
  });
  window.addEventListener("pointermove", (event) => {
    if (!held) return;
    if (!wasDragged && Math.hypot(event.clientX - held.clientX, event.clientY - held.clientY) < 4) return;
    wasDragged = true;
    const now = place(event);
    x += held.x - now.x;
    y += held.y - now.y;
    show();
  });
  for (const name of ["pointerup", "pointercancel"]) window.addEventListener(name, () => { held = null; });
  svg.addEventListener("dragstart", (event) => event.preventDefault());
  svg.addEventListener("click", (event) => { if (wasDragged) event.preventDefault(); }, { capture: true });
  return { by, whole: () => by(0) };
}
