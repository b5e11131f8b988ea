"use strict";
// One film holds all clips of a question, and each canvas shows its part of it: so they turn in step.
const { study, size } = document.body.dataset;
const questions = [...document.querySelectorAll(".question")];
const film = document.getElementById("film");
const status = document.getElementById("status");
const [back, next, save] = ["back", "next", "save"].map((name) => document.getElementById(name));
const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
const answers = recalled();
let shown = 0;

function recalled() {
  try {
    const kept = JSON.parse(localStorage.getItem(`ballot-${study}`));
    if (kept && kept.ballot && !kept.isSaved) return kept; // who opens the page after a ballot was saved, has a new one
  } catch { /* a browser that keeps nothing for files */ }
  const random = crypto.getRandomValues(new Uint8Array(6));
  return { ballot: [...random].map((byte) => byte.toString(16).padStart(2, "0")).join(""), ranks: {} };
}

function keep() {
  try {
    localStorage.setItem(`ballot-${study}`, JSON.stringify(answers));
  } catch { /* the answers last as long as the page is open */ }
}

function list(words) {
  return words.length < 2 ? words.join("") : `${words.slice(0, -1).join(", ")} and ${words[words.length - 1]}`;
}

// What a question still lacks, as a sentence; empty for a complete one.
function complaint(question) {
  const { number } = question.dataset;
  const letters = [...question.querySelectorAll("fieldset")].map((option) => option.dataset.letter);
  const open = letters.filter((letter) => !answers.ranks[`${number}-${letter}`]);
  for (const label of question.querySelectorAll("fieldset:first-of-type label")) {
    const rank = label.querySelector("input").value;
    const same = letters.filter((letter) => answers.ranks[`${number}-${letter}`] === rank);
    if (same.length > 1) return `Question ${number}: clips ${list(same)} have the same rank, ${label.textContent.trim()}; change one.`;
  }
  return open.length ? `Question ${number}: give ${open.length > 1 ? "clips" : "clip"} ${list(open)} a rank.` : "";
}

function show(index) {
  shown = index;
  questions.forEach((question, place) => { question.hidden = place !== index; });
  back.hidden = index === 0;
  next.hidden = index === questions.length - 1;
  save.hidden = !next.hidden;
  status.textContent = "";
  document.querySelector("details").open = index === 0;
  const bytes = atob(questions[index].querySelector("template").content.textContent);
  URL.revokeObjectURL(film.src);
  film.src = URL.createObjectURL(new Blob([Uint8Array.from(bytes, (x) => x.charCodeAt(0))], { type: "video/mp4" }));
  if (!still) film.play().catch(() => { /* its button says Play */ });
}

function go(step) {
  const problem = step > 0 ? complaint(questions[shown]) : "";
  if (problem) { status.textContent = problem; return; }
  show(shown + step);
  questions[shown].querySelector("h2").focus();
  scrollTo(0, 0);
}

function draw() {
  const question = questions[shown];
  if (film.readyState >= film.HAVE_CURRENT_DATA) {
    for (const canvas of question.querySelectorAll("canvas")) {
      const { column, row } = canvas.dataset;
      canvas.getContext("2d").drawImage(film, column * size, row * size, size, size, 0, 0, size, size);
    }
    if (!film.paused) question.querySelector(".turn").value = 360 * film.currentTime / film.duration;
  }
  question.querySelector(".play").textContent = film.paused ? "Play" : "Pause";
  requestAnimationFrame(draw);
}

function csv() {
  const lines = ["study,ballot,question,option,rank"];
  for (const input of document.querySelectorAll("fieldset input:checked")) {
    lines.push([study, answers.ballot, ...input.name.split("-"), input.value].join(","));
  }
  return `${lines.join("\n")}\n`;
}

function saveBallot() {
  const index = questions.findIndex(complaint);
  if (index >= 0) {
    if (index !== shown) show(index);
    status.textContent = complaint(questions[index]);
    return;
  }
  const link = document.createElement("a");
  link.download = `ballot-${answers.ballot}.csv`;
  link.href = URL.createObjectURL(new Blob([csv()], { type: "text/csv" }));
  link.click();
  answers.isSaved = true;
  keep();
  status.textContent = `Saved as ${link.download}, where this browser puts downloads. Please send this file to the person who gave you this page. For a ballot of somebody else, open the page again.`;
}

for (const question of questions) {
  const turn = question.querySelector(".turn");
  question.querySelector(".play").addEventListener("click", () => (film.paused ? film.play() : film.pause()));
  turn.addEventListener("input", () => {
    film.pause();
    film.currentTime = Math.min(turn.value / 360 * film.duration, film.duration - 0.01);
  });
  for (const input of question.querySelectorAll("fieldset input")) {
    input.checked = answers.ranks[input.name] === input.value;
    input.addEventListener("change", () => {
      answers.ranks[input.name] = input.value;
      keep();
      const problem = complaint(question);
      status.textContent = problem.includes("same rank") ? problem : "";
    });
  }
}
film.addEventListener("error", () => {
  status.textContent = "This browser cannot play the clips (H.264); open the page in another one.";
});
back.addEventListener("click", () => go(-1));
next.addEventListener("click", () => go(1));
save.addEventListener("click", saveBallot);
show(Math.max(0, questions.findIndex(complaint)));
draw();
