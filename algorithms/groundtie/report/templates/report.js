"use strict";
for (const viewer of document.querySelectorAll(".viewer")) {
  const slider = viewer.querySelector("input[type=range]");
  const stage = viewer.querySelector(".stage");
  const place = () => viewer.style.setProperty("--at", slider.value);
  slider.addEventListener("input", place);
  viewer.addEventListener("change", (event) => {
    if (event.target.type === "checkbox") {
      viewer.dataset[event.target.name] = event.target.checked ? "shown" : "hidden";
    }
    if (event.target.type === "radio") viewer.dataset[event.target.name] = event.target.value;
  });
  const drag = (event) => {
    if (!event.buttons || viewer.dataset.mode !== "swipe") return;
    const box = stage.getBoundingClientRect();
    slider.value = 100 * (event.clientX - box.left) / box.width;
    place();
  };
  stage.addEventListener("pointerdown", drag);
  stage.addEventListener("pointermove", drag);
  stage.addEventListener("dragstart", (event) => event.preventDefault());
  place();
}
for (const viewer of document.querySelectorAll(".flicker")) {
  const slider = viewer.querySelector("input[type=range]");
  const play = viewer.querySelector("input[name=play]");
  const captions = viewer.querySelectorAll(".caption-of");
  const show = () => {
    for (const state of ["nominal", "registered"]) {
      viewer.querySelectorAll(`img.${state}`).forEach((image, number) => {
        image.hidden = state !== viewer.dataset.state || number !== Number(slider.value);
      });
    }
    viewer.querySelector("output").textContent = captions[slider.value].textContent;
  };
  viewer.addEventListener("change", (event) => {
    if (event.target.type === "radio") viewer.dataset.state = event.target.value;
    show();
  });
  slider.addEventListener("input", () => {
    play.checked = false;
    show();
  });
  setInterval(() => {
    if (!play.checked) return;
    slider.value = (Number(slider.value) + 1) % (Number(slider.max) + 1);
    show();
  }, 700);
  show();
}
