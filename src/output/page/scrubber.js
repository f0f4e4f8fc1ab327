"use strict";
// Shows the pictures of one frame after the other: by the slider, the arrow keys, Home and End, the button, or a click on a chart.
const frames = JSON.parse(document.getElementById("frames").textContent);
const slider = document.getElementById("frame");
const button = document.getElementById("play");
const caption = document.getElementById("caption");
const pictures = [...document.querySelectorAll("img[data-layer]")];
let timer = 0;

function show(index) {
  const at = Math.max(0, Math.min(frames.length - 1, index));
  const { frame, text } = frames[at];
  slider.value = at;
  slider.setAttribute("aria-valuetext", `frame ${frame}`);
  caption.textContent = text;
  for (const picture of pictures) {
    const layer = picture.dataset.layer;
    picture.src = frames[at][layer] || "data:image/gif;base64,R0lGODlhAQABAAAAACw=";
    picture.alt = `${layer} of frame ${frame}` + (frames[at][layer] ? "" : ", not written");
  }
  document.querySelectorAll("rect.current").forEach((bar) => bar.classList.remove("current"));
  document.querySelectorAll(`rect[data-frame="${frame}"]`).forEach((bar) => bar.classList.add("current"));
}

function play(on) {
  clearInterval(timer);
  timer = on ? setInterval(() => show((Number(slider.value) + 1) % frames.length), 1000 / Number(button.dataset.rate)) : 0;
  button.textContent = on ? "Stop" : "Play";
}

slider.addEventListener("input", () => show(Number(slider.value)));
button.addEventListener("click", () => play(!timer));
document.addEventListener("keydown", (event) => {
  // The slider knows these keys itself; with modifiers they are the browser's.
  if (event.target === slider || event.ctrlKey || event.altKey || event.metaKey) return;
  const at = Number(slider.value);
  const to = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: frames.length - 1 }[event.key];
  if (to === undefined) return;
  event.preventDefault();
  show(to);
});
document.addEventListener("click", (event) => {
  const number = event.target.closest("rect[data-frame]")?.dataset.frame;
  if (number === undefined) return;
  // Not every frame of a long sequence has pictures: the last one before it then.
  show(frames.findLastIndex(({ frame }) => frame <= Number(number)));
});
show(0);
