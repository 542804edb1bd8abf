"use strict";
// Saves a chart as PNG: the server's SVG, drawn twice as large.
for (const button of document.querySelectorAll("[data-png]")) {
  button.hidden = false;
  button.addEventListener("click", () => {
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      canvas.width = 2 * image.width;
      canvas.height = 2 * image.height;
      const context = canvas.getContext("2d");
      context.scale(2, 2);
      context.drawImage(image, 0, 0);
      canvas.toBlob((content) => {
        const link = document.createElement("a");
        link.href = URL.createObjectURL(content);
        link.download = `${button.dataset.name}.png`;
        link.click();
        button.dataset.saved = String(content.size);
        setTimeout(() => URL.revokeObjectURL(link.href), 1000);
      }, "image/png");
    };
    image.src = button.dataset.png;
  });
}
// A changed filter takes effect at once.
for (const form of document.querySelectorAll("form.filters:not(#choices)")) {
  for (const select of form.querySelectorAll("select")) select.addEventListener("change", () => form.requestSubmit());
  form.addEventListener("submit", () => {
    for (const field of form.elements) if (field.name && field.value === "") field.disabled = true;
  });
  window.addEventListener("pageshow", () => { for (const field of form.elements) field.disabled = false; });
}
// A page opened with ‹ and › keys where it has a page before and after.
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input, select, textarea, [tabindex='0'], .editor *")) return;
  const rel = { ArrowLeft: "prev", ArrowRight: "next" }[event.key];
  document.querySelector(`main a[rel=${rel}]`)?.click();
});
// What takes longer than a page should is fetched when the page is there; without an answer its link stays.
for (const part of document.querySelectorAll("[data-load]")) {
  fetch(part.dataset.load)
    .then((answer) => (answer.ok ? answer.text() : ""))
    .then((html) => { if (html.trim()) part.innerHTML = html; part.dataset.loaded = "1"; });
}
