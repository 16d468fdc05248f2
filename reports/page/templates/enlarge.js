// Pictures in links of class "enlarge" open in the dialog. Escape, the button and a click beside the picture close it;
// the focus then returns to the link. The arrow keys show the next picture of the same kind in the
// strip: the same view by the next method.
const dialog = document.querySelector("dialog");
const picture = new Image();
const words = dialog.querySelector("p");
const [before, after] = dialog.querySelectorAll("[data-step]");
let link = null;
dialog.prepend(picture);

function neighbour(step) {
  const group = link.closest(".group, .views, .tiles");
  const links = group ? [...group.querySelectorAll(`a.enlarge[data-kind="${link.dataset.kind}"]`)] : [link];
  return links[links.indexOf(link) + step];
}

function show(next) {
  link = next;
  const shown = link.querySelector("img");
  picture.src = link.href;
  picture.alt = shown.alt;
  words.textContent = shown.alt;
  before.disabled = !neighbour(-1);
  after.disabled = !neighbour(1);
}

function step(by) {
  const next = neighbour(by);
  if (next) show(next);
}

document.addEventListener("click", (event) => {
  const next = event.target.closest("a.enlarge");
  if (!next || event.ctrlKey || event.metaKey || event.shiftKey) return;
  event.preventDefault();
  show(next);
  dialog.showModal();
});
dialog.addEventListener("click", (event) => {
  if (event.target === dialog || event.target.closest("[data-close]")) dialog.close();
  else if (event.target.closest("[data-step]")) step(Number(event.target.dataset.step));
});
dialog.addEventListener("keydown", (event) => {
  if (event.key === "ArrowLeft") step(-1);
  if (event.key === "ArrowRight") step(1);
});
dialog.addEventListener("close", () => link.focus());
