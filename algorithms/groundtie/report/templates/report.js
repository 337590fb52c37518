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
