
// Two pictures one over the other: what is left of the slider is the first, what is right of it the second.
"use strict";
for (const box of document.querySelectorAll(".compare")) {
  const chosen = box.querySelectorAll("select");
  const images = box.querySelectorAll("img");
  const slider = box.querySelector("input");
  const show = () => {
    chosen.forEach((select, side) => {
      images[side].src = document.getElementById(select.value).src;
      images[side].alt = select.selectedOptions[0].text;
    });
    images[1].style.clipPath = `inset(0 0 0 ${slider.value}%)`;
  };
  box.addEventListener("input", show);
  show();
}
