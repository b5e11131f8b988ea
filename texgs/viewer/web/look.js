// A new look: a picture or words for a part of the scene or all of it. A picture shows at once, as a preview.

import { element, slider } from "./inputs.js";

const get = (id) => document.getElementById(id);
const ALL = ""; // parts
const FREE = 1; // hue
const REST = 400; // milliseconds without a change, after which thumbnails are made

export class LookTool {
  #page;
  #painting = 0; // timer of the thumbnails that count
  #painted = new Map(); // what the pictures of thumbnails show
  #hue = FREE; // how far the look may leave the hues of the functions
  #isTried = false; // whether the page shows a preview, or a look on its way

  /**
   * @param {object} page - with camera, canvas, connection, job, notices, renderer, shown, state, beginLook() and show()
   * @param {{styles: string[], words: string[]}} choices - pictures and words that the server knows
   */
  constructor(page, { styles, words }) {
    this.#page = page;
    get("look-known").append(...words.map((word) => new Option(word)));
    for (const name of styles) this.#addStyle(name);
    get("look-words").addEventListener("input", () => this.#choose(null));
    get("look-file").addEventListener("change", ({ target }) => this.#send(target.files));
    get("look").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#page.job.begin(this.#asked(false));
    });
    for (const id of ["look-part", "look-sphere", "look-words"]) get(id).addEventListener("change", () => this.#preview());
    const hue = slider("Hue", "hue of the look", { max: FREE, most: FREE, step: 0.05, unedited: FREE }, (value) => {
      hue.show(this.#hue = value ?? FREE);
      this.#preview();
    });
    hue.show(this.#hue);
    get("look-hue").prepend(hue.row);
    get("look-close").onclick = () => this.leave();
    get("look").addEventListener("keydown", ({ key }) => { if (key === "Escape") this.leave(); });
    this.#takeDrops();
    const { connection, job, state } = page;
    connection.addEventListener("message", ({ detail }) => {
      if (detail.type === "trial") this.#try(detail.parts);
    });
    connection.addEventListener("lost", () => this.#try([]));
    for (const event of ["begin", "end"]) job.addEventListener(event, () => this.#show());
    job.addEventListener("end", () => this.paint());
    state.addEventListener("change", () => this.#showParts());
    this.#showParts();
  }

  /** Begin with a part; with all by default. */
  start(part = ALL) {
    get("look").hidden = false;
    get("look-part").value = part;
    if (get("look-part").selectedIndex < 0) get("look-part").selectedIndex = 0;
    get("look-styles").querySelector("input").focus();
    this.#show();
    this.paint();
  }

  /** Soon show the pictures on the scene as the camera has it, one after the other; those that are so stay. */
  paint() {
    clearTimeout(this.#painting);
    if (!get("look").hidden) this.#painting = setTimeout(() => this.#paint(), REST);
  }

  /** Take the preview off, and close. */
  leave() {
    if (get("look").hidden) return;
    this.#page.job.leave("look");
    if (get("look").contains(document.activeElement)) this.#page.canvas.focus();
    get("look").hidden = true;
  }

  get #style() {
    return get("look").querySelector("input[name=style]:checked")?.value ?? "";
  }

  get #hasPart() {
    return get("look-part").selectedIndex >= 0;
  }

  async #paint() {
    const turn = this.#painting, { camera, job, notices, renderer, state } = this.#page;
    const isOver = () => turn !== this.#painting || get("look").hidden || job.isAtWork || !this.#hasPart;
    for (const label of get("look-styles").children) {
      if (isOver()) return;
      const style = label.querySelector("input").value, side = camera.wire(...renderer.size());
      const look = JSON.stringify({ ...this.#asked(true), style, instruction: "", camera: side });
      const key = look + JSON.stringify(state.scene), picture = label.querySelector("img");
      if (this.#painted.get(picture) === key) continue;
      const answer = await fetch(`thumbnail.jpg?${new URLSearchParams({ look })}`).catch(() => null);
      if (!answer) return;
      this.#painted.set(picture, key);
      label.classList.toggle("wrong", !answer.ok);
      if (answer.ok) {
        URL.revokeObjectURL(picture.src);
        picture.src = URL.createObjectURL(await answer.blob());
      } else {
        notices.tell(await answer.text(), "error");
      }
    }
  }

  #addStyle(name, title = name) {
    const input = element("input", { type: "radio", name: "style", value: name });
    input.addEventListener("change", () => this.#choose(input));
    const picture = element("img", { alt: "", width: 72, height: 72 });
    get("look-styles").append(element("label", { className: "style", title }, input, picture, title));
    return input;
  }

  /** Follow this picture; null: words. */
  #choose(style) {
    for (const each of get("look-styles").querySelectorAll("input")) each.checked = each === style;
    if (style) get("look-words").value = "";
    this.#preview(style);
  }

  /** Give the server picture files. */
  async #send(files) {
    for (const file of files) {
      try {
        const address = `styles?${new URLSearchParams({ name: file.name })}`;
        const answer = await fetch(address, { method: "POST", body: file });
        if (!answer.ok) throw new Error(await answer.text());
        this.#choose(this.#addStyle(await answer.text(), file.name));
      } catch (error) {
        this.#page.notices.tell(`${file.name} cannot be used: ${error.message}`, "error");
      }
    }
    this.paint();
    get("look-file").value = "";
  }

  #takeDrops() {
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      if (!event.dataTransfer.files.length || this.#page.job.isAtWork) return;
      if (get("look").hidden) this.#page.beginLook();
      if (!get("look").hidden) this.#send(event.dataTransfer.files);
    });
  }

  /** Show on the part what is chosen, a picture or words; or nothing. */
  #preview(chosen = this.#style || get("look-words").value.trim()) {
    const { connection } = this.#page;
    if (chosen && this.#hasPart) connection.send(this.#asked(true));
    else connection.send({ type: "cancel", preview: true }); // one may be on its way
    this.#show();
    this.paint();
  }

  #asked(preview) {
    const part = get("look-part").value, instruction = get("look-words").value.trim();
    const parts = part === ALL ? [] : [part], sphere = get("look-sphere").checked;
    const { camera, renderer } = this.#page, hue = this.#hue;
    const side = preview && instruction ? camera.wire(...renderer.size()) : null;
    return { type: "look", parts, style: this.#style, instruction, sphere, hue, preview, camera: side };
  }

  #try(parts) {
    this.#isTried = parts.length > 0;
    this.#page.show({ before: this.#page.shown.before && !this.#isTried });
    this.#show();
  }

  /** Offer the parts that can have a look. */
  #showParts() {
    const { models } = this.#page.state.scene, select = get("look-part"), { value } = select;
    const able = models.filter((model) => model.can.includes("look"));
    const parts = able.flatMap(({ name, segments }) => [name, ...segments.map((each) => `${name}/${each.name}`)]);
    const all = able.length === models.length ? [new Option("the whole scene", ALL)] : [];
    select.replaceChildren(...all, ...parts.map((part) => new Option(part)));
    if ([...select.options].some((option) => option.value === value)) select.value = value;
    else if (!get("look").hidden) select.selectedIndex = -1; // it is gone: another one has to be chosen
    this.#show();
  }

  #show() {
    const { isAtWork } = this.#page.job, hasWords = get("look-words").value.trim() !== "";
    const isReady = (hasWords || this.#style) && this.#hasPart && !isAtWork;
    get("look-make").disabled = !isReady;
    for (const each of get("look").querySelectorAll("input, select, fieldset")) each.disabled = isAtWork;
    get("look-note").textContent = this.#isTried && !isAtWork ? "A preview: nothing has changed yet." : "";
  }
}
