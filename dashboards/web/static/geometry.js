"use strict";
// Shapes of the editor: things of one or several polygons, poses, and how they are drawn.
const SVG = "http://www.w3.org/2000/svg";
const make = (name, attributes, parent) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return parent ? parent.appendChild(made) : made;
};
const written = (points) => points.map(([x, y]) => `${x},${y}`).join(" ");
const round = (value) => Math.round(value * 1000) / 1000;
const rounded = (thing) => thing.map((polygon) => polygon.map(([x, y]) => [round(x), round(y)]));
const centre = (thing) => {
  const every = thing.flat();
  return [0, 1].map((i) => (Math.min(...every.map((point) => point[i])) + Math.max(...every.map((point) => point[i]))) / 2);
};
const moved = (thing, dx, dy) => thing.map((polygon) => polygon.map(([x, y]) => [x + dx, y + dy]));
const turned = (thing, angle, [cx, cy]) => {
  const cos = Math.cos(angle), sin = Math.sin(angle);
  return thing.map((polygon) => polygon.map(([x, y]) => [cx + cos * (x - cx) - sin * (y - cy), cy + sin * (x - cx) + cos * (y - cy)]));
};
// A place or a pose, moved and turned.
const placed = (pose, dx, dy, angle) => {
  const heading = pose.slice(2).map((was) => Math.atan2(Math.sin(was + angle), Math.cos(was + angle)));
  return [round(pose[0] + dx), round(pose[1] + dy), ...heading];
};
