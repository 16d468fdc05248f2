// State, controls, pointers and keys, and when to draw what.

const byId = (name) => document.getElementById(name);
const within = (value, low, high) => Math.min(Math.max(value, low), high);
const toLinear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
const toSrgb = (c) => (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055);
const code = (c) => Math.round(255 * toSrgb(within(c, 0, 1))).toString(16).padStart(2, "0");
const hex = (rgb) => `#${rgb.map(code).join("")}`;
const linear = (text) => [1, 3, 5].map((at) => toLinear(parseInt(text.slice(at, at + 2), 16) / 255));
const rounded = (value, digits = 2) => `${Number(value.toPrecision(digits))}`; // never in powers of ten
const nextFrame = () => new Promise(requestAnimationFrame);
const percent = (share) => `${rounded(100 * share)} %`;

const LIMITS = { plane: { tilt: [2, 89], turn: [-180, 180] }, sphere: { tilt: [-75, 80], turn: [-180, 180] },
  drape: { tilt: [-35, 60], turn: [-75, 75] } };
const YARN = { roughness: ["Roughness", 0.05, 1, 0.01, ""], twist: ["Twist", -60, 60, 1, "°"],
  blend: ["Round shading", 0, 1, 0.01, ""] };
const TILES = { truth: "Truth", flat: "Truth, flat footprints", map_material: "Texture maps" };
const FRAME = 1000 / 30; // milliseconds of a coarse picture
const STRIP = 250; // milliseconds of a strip of the full one
const MOST_PIXELS = 1.6e6;
const ERROR_SIZE = 128;

class Viewer {
  constructor(content, source) {
    this.content = content;
    this.canvas = byId("cloth");
    this.picture = new Picture(this.canvas, source, content);
    this.levels = content.tables.filter((table) => table.bend === 1 && table.width === 1).map((table) => table.level);
    this.usual = this.levels.includes(2) ? 2 : this.levels[0];
    this.scale = 1 / 8;
    this.job = 0;
    this.first = true; // until a picture is seen; it is of points, because the shader of soft nodes compiles longer
    this.reset();
  }

  reset() {
    const { content } = this;
    const own = (factors) => factors.indexOf(1);
    this.state = {
      exposure: 0, left: "point", right: String(this.usual), wipe: 0.5, bend: own(content.bends),
      width: own(content.widths), warp: { ...content.warp }, weft: { ...content.weft }, thickness: content.thickness,
      colours: content.colours.map((colour) => [...colour]), view: null, target: [0, 0],
    };
    return this.go(content.start);
  }

  // Take a view of the page, one that has tiles.
  go(index) {
    const view = this.content.views[index];
    return this.set({
      shape: view.shape, turn: view.turn, tilt: view.tilt, distance: view.distance, lightTurn: view.light_turn,
      lightTilt: view.light_tilt, target: [...view.target], view: index,
    });
  }

  // Change the state and draw it; returns a promise of the finished picture.
  set(changes) {
    const next = { ...this.state, ...changes };
    const camera = ["shape", "turn", "tilt", "distance", "lightTurn", "lightTilt", "target"];
    if (!("view" in changes) && camera.some((name) => name in changes)) next.view = null;
    const { tilt, turn } = LIMITS[next.shape];
    next.tilt = within(next.tilt, ...tilt);
    next.turn = within(next.turn, ...turn);
    next.distance = within(next.distance, 4, 2000);
    next.lightTurn = ((next.lightTurn + 540) % 360) - 180;
    next.lightTilt = within(next.lightTilt, this.content.through ? -90 : 2, 90);
    next.wipe = within(next.wipe, 0, 1);
    this.state = next;
    this.shown?.(next);
    return this.draw();
  }

  // Whether the yarns are as they are in the fabric, but for their colours.
  get own() {
    const { state, content } = this;
    const same = (family) => Object.keys(YARN).every((name) => state[family][name] === content[family][name]);
    return content.bends[state.bend] === 1 && content.widths[state.width] === 1
      && state.thickness === content.thickness && same("warp") && same("weft");
  }

  // Whether there is a tile of a name: they show views of the page with the fabric's own yarns.
  tiled(name) {
    const { state, content } = this;
    return state.view !== null && name in (content.views[state.view].tiles ?? {}) && this.own;
  }

  // The method of a name as it can be drawn in this state, and its label.
  method(name) {
    const { state } = this;
    if (this.tiled(name)) {
      return { kind: TILE, view: state.view, tile: name, level: this.usual, label: TILES[name] };
    }
    if (name === "point" || this.first || !this.picture.knows(NODES)) {
      return { kind: POINT, level: this.usual, label: "One point a pixel" };
    }
    const wished = name === "truth" ? Math.max(...this.levels) : name in TILES ? this.usual : Number(name);
    const level = this.picture.indexOf(state, wished) === undefined ? this.usual : wished;
    return { kind: NODES, level, label: `Soft nodes, detail ${level}` };
  }

  get methods() { return [this.method(this.state.left), this.method(this.state.right)]; }

  // Draw; returns a promise of the full picture of the newest state.
  draw() {
    this.job += 1;
    clearTimeout(this.settling);
    this.wake?.();
    if (!this.busy) this.drawn = this.work();
    return this.drawn;
  }

  async work() {
    this.busy = true;
    try {
      let job;
      do {
        await nextFrame();
        ({ job } = this);
        await this.frame(job);
      } while (job !== this.job);
    } finally {
      this.busy = false;
    }
  }

  // Draw at once as many pixels as a frame has time for, and all of them when nothing has moved for a moment.
  async frame(job) {
    const { picture, canvas, methods, state } = this;
    const ready = await picture.prepare(state, methods);
    let whole = this.size;
    if (this.resized) [canvas.width, canvas.height] = whole;
    const columns = ([width]) => Math.round(width * state.wipe);
    let spent;
    if (methods.some((method) => method.kind === TILE)) {
      const { size } = this.content.views[state.view];
      const side = Math.min(...whole);
      const corner = whole.map((length) => (length - side) >> 1);
      const wipe = Math.round(within((whole[0] * state.wipe - corner[0]) / side, 0, 1) * size);
      const box = [...corner, ...corner.map((low) => low + side)];
      picture.gl.clear(picture.gl.COLOR_BUFFER_BIT);
      whole = [size, size];
      spent = await picture.small(state, ready, whole, wipe, box, false);
      if (this.first) this.job += 1;
      this.first = false;
    } else {
      const size = whole.map((length) => Math.max(16, Math.round(length * this.scale)));
      spent = await picture.small(state, ready, size, columns(size), [0, 0, ...whole], true);
      this.scale = within(this.scale * Math.sqrt(FRAME / spent), 0.08, 1);
      this.show("coarse", methods, state);
      if (this.first) this.job += 1;
      this.first = false;
      if (size[1] < whole[1] && job === this.job) {
        await new Promise((done) => { this.wake = done; setTimeout(done, 150); });
        spent = await this.refine(job, state, ready, whole, columns(whole));
      }
    }
    if (job !== this.job) return;
    this.show("full", methods, state);
    this.tell(job, spent, whole);
  }

  // Draw all pixels over a coarse picture, a strip at a time from above, so that the page keeps answering.
  async refine(job, state, ready, whole, wipe) {
    const { picture } = this;
    let [spent, high, rows] = [0, whole[1], whole[1] / 32]; // coarse pictures do not tell the time of a strip
    while (high > 0 && job === this.job) {
      const low = Math.max(0, high - Math.round(within(rows, 4, whole[1])));
      const own = await picture.timed(() => picture.draw(state, ready, whole, [low, high], wipe));
      rows = ((high - low) * STRIP) / own;
      spent += own;
      high = low;
    }
    return spent;
  }

  // Say how far the picture is; what is written about it is dim until it is full.
  show(stage, methods, state) {
    document.body.className = stage;
    byId("line").style.left = `${100 * state.wipe}%`;
    ["left", "right"].forEach((side, index) => { byId(`label-${side}`).textContent = methods[index].label; });
    byId("notice").textContent = this.notice();
  }

  // Write what belongs to the full picture: at once its time and the size of a pixel, later how far its sides differ.
  tell(job, spent, [width, height]) {
    const time = spent < 1000 ? `${rounded(spent)} ms` : `${rounded(spent / 1000)} s`;
    byId("speed").textContent = `${time}, ${width} × ${height} pixels`;
    const size = (2 * this.content.shapes.spread * this.state.distance) / Math.min(width, height);
    byId("footprint").textContent = `${rounded(size)} yarns`;
    byId("error").textContent = this.picture.floats ? "…" : "not known on this device";
    if (this.picture.floats) this.settling = setTimeout(() => { if (job === this.job) this.measure(); }, 400);
  }

  // The pixels of the canvas as large as it is shown, within a limit.
  get size() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const ratio = Math.min(devicePixelRatio, Math.sqrt(MOST_PIXELS / Math.max(width * height, 1)));
    return [width, height].map((length) => Math.max(1, Math.round(length * ratio)));
  }

  get resized() { return this.size[0] !== this.canvas.width || this.size[1] !== this.canvas.height; }

  // What is shown in place of a method that has no picture of this state.
  notice() {
    const { state, content } = this;
    const names = [...new Set([state.left, state.right])];
    const said = names.filter((name) => name in TILES && !this.tiled(name)).map((name) => {
      const known = content.views.filter((view) => name in (view.tiles ?? {})).map((view) => view.name);
      return `${TILES[name]}: known at ${known.join(", ")} alone, of the yarns as they are.`;
    });
    const wished = names.some((name) => name !== "point" && !this.tiled(name));
    if (wished && !this.first && !this.picture.knows(NODES)) {
      said.push("Soft nodes: their shader does not compile here. One point is shown instead.");
    } else if (said.length) said.push("Soft nodes are shown instead.");
    return said.join(" ");
  }

  // Root of the mean squared difference of colour between two pictures, as a share of the second one's mean.
  difference(a, b) {
    const { colours } = this.state;
    let [squares, sum] = [0, 0];
    for (let at = 0; at < b.length; at += 4) {
      if (a[at] < 0 || b[at] < 0) continue;
      for (let c = 0; c < 3; c += 1) {
        let [first, second] = [0, 0];
        for (let k = 0; k < 4; k += 1) {
          first += colours[k][c] * a[at + k];
          second += colours[k][c] * b[at + k];
        }
        squares += (first - second) ** 2;
        sum += second;
      }
    }
    const count = b.filter((value, at) => at % 4 === 0 && value >= 0 && a[at] >= 0).length * 3;
    return count && sum ? Math.sqrt(squares / count) / (sum / count) : 0;
  }

  async measure() {
    const { state, picture, job } = this;
    const view = this.tiled("truth") ? this.content.views[state.view] : null;
    const size = view ? view.size : ERROR_SIZE;
    const [left, right] = this.methods;
    const reference = view ? this.method("truth") : right;
    const found = [];
    for (const method of view ? [left, right, reference] : [left, right]) {
      found.push(await picture.components(state, method, size));
      await nextFrame();
      if (job !== this.job) return;
    }
    if (view) {
      const errors = found.slice(0, 2).map((picture) => percent(this.difference(picture, found[2])));
      byId("error-name").textContent = "Error against the truth";
      byId("error").textContent = `left ${errors[0]}, right ${errors[1]} (the truth itself ${percent(view.standard_error)})`;
    } else {
      byId("error-name").textContent = "The sides differ by";
      byId("error").textContent = `${percent(this.difference(found[0], found[1]))} of the mean colour`;
    }
  }
}

// ---- controls ------------------------------------------------------------------------------------------------------

// A slider with its label and its number; `read` gives the number of a state, `write` the changes for a new one.
function range(place, label, title, [low, high, step], read, write, text, log, bind) {
  const row = document.createElement("label");
  const [name, input, output] = ["span", "input", "output"].map((tag) => row.appendChild(document.createElement(tag)));
  row.className = "range";
  name.textContent = label;
  const forth = log ? Math.log : (value) => value;
  const back = log ? Math.exp : (value) => value;
  Object.assign(input, { type: "range", min: forth(low), max: forth(high), step: log ? 0.01 : step });
  input.setAttribute("aria-label", title);
  row.classList.toggle("fixed", low === high);
  input.disabled = low === high;
  bind.input(input, () => write(back(Number(input.value))));
  bind.updates.push((state) => {
    const value = read(state);
    input.value = forth(value);
    output.textContent = text(value);
    input.setAttribute("aria-valuetext", text(value));
  });
  input.dataset.name = title;
  place.appendChild(row);
}

function makeRanges(viewer, bind) {
  const { content } = viewer;
  const limits = { bend: [0, content.bends.length - 1, 1], width: [0, content.widths.length - 1, 1],
    ...(content.through && { lightTilt: [-90, 90, 1] }) };
  for (const place of document.querySelectorAll("[data-range]")) {
    const { range: name, label, title, min, max, step, unit = "" } = place.dataset;
    const digits = (value) => (Math.abs(value) >= 100 || step === "1" ? value.toFixed(0) : value.toPrecision(2));
    let text = (value) => digits(value) + unit;
    if ("stops" in place.dataset) {
      const [key, values] = name === "bend" ? ["bends", content.bends] : ["widths", content.widths];
      text = (index) => {
        const table = content.tables.find((found) => found[name] === values[index]);
        return table[key].map((value) => (name === "bend" ? `${value.toFixed(0)}°` : value.toFixed(2))).join(", ");
      };
    }
    range(place, label, title ?? label, limits[name] ?? [Number(min), Number(max), Number(step)],
      (state) => state[name], (value) => ({ [name]: value }), text, "log" in place.dataset, bind);
  }
  ["warp", "weft"].forEach((family, index) => {
    const group = byId("yarns").appendChild(document.createElement("div"));
    group.className = "yarn";
    const head = group.appendChild(document.createElement("h2"));
    const title = family === "warp" ? "Warp" : "Weft";
    head.appendChild(document.createElement("span")).textContent = title;
    [["Colour", 2 + index], ["Gloss", index]].forEach(([kind, component]) => {
      const label = head.appendChild(document.createElement("label"));
      label.className = "colour";
      label.append(kind);
      const input = label.appendChild(document.createElement("input"));
      input.type = "color";
      input.dataset.name = `${title}, ${kind.toLowerCase()}`;
      input.setAttribute("aria-label", input.dataset.name);
      bind.input(input, () => ({
        colours: viewer.state.colours.map((colour, at) => (at === component ? linear(input.value) : colour)),
      }));
      bind.updates.push((state) => { input.value = hex(state.colours[component]); });
    });
    for (const [name, [label, low, high, step, unit]] of Object.entries(YARN)) {
      range(group, label, `${title}, ${label.toLowerCase()}`, [low, high, step], (state) => state[family][name],
        (value) => ({ [family]: { ...viewer.state[family], [name]: value } }),
        (value) => value.toFixed(unit ? 0 : 2) + unit, false, bind);
    }
  });
}

function makeChoices(viewer, bind) {
  viewer.content.views.forEach((view, index) => {
    const button = byId("views").appendChild(document.createElement("button"));
    Object.assign(button, { type: "button", textContent: view.name });
    button.addEventListener("click", () => viewer.go(index));
    bind.updates.push((state) => button.setAttribute("aria-pressed", state.view === index));
  });
  const names = [["point", "One point a pixel"], ...viewer.levels.map((level) => [String(level), `Soft nodes, detail ${level}`])];
  names.push(...viewer.content.tiles.map((name) => [name, TILES[name]]));
  for (const side of ["left", "right"]) {
    names.forEach(([name, text]) => byId(side).add(new Option(text, name)));
    byId(side).addEventListener("change", () => {
      const value = byId(side).value;
      viewer.set({ [side]: value });
      if (!(value in TILES) || viewer.tiled(value)) return;
      const known = viewer.content.views.filter((view) => value in view.tiles);
      const view = known.find(({ shape }) => shape === viewer.state.shape) ?? known[0];
      viewer.go(viewer.content.views.indexOf(view));
    });
    bind.updates.push((state) => { byId(side).value = state[side]; });
  }
  bind.input(byId("wipe"), () => ({ wipe: Number(byId("wipe").value) }));
  bind.updates.push((state) => { byId("wipe").value = state.wipe; });
  byId("reset").addEventListener("click", () => viewer.reset());
}

// The light as a point on the sky seen from above: its middle is the zenith, below is the viewer's side.
function makePad(viewer, bind) {
  const [pad, dot] = [byId("pad"), byId("dot")];
  const move = (event) => {
    if (!event.buttons) return;
    const box = pad.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
    const far = Math.min((Math.hypot(x, y) * 2.3) / box.width, 1);
    viewer.set({ lightTurn: (Math.atan2(x, y) * 180) / Math.PI, lightTilt: 90 * (1 - far) });
  };
  pad.addEventListener("pointerdown", (event) => { pad.setPointerCapture(event.pointerId); move(event); });
  pad.addEventListener("pointermove", move);
  bind.updates.push((state) => {
    const far = 1 - state.lightTilt / 90;
    dot.setAttribute("cx", far * Math.sin(radians(state.lightTurn)));
    dot.setAttribute("cy", far * Math.cos(radians(state.lightTurn)));
  });
}

// ---- pointers and keys ---------------------------------------------------------------------------------------------

function shifted(state, right, up) {
  const [cosine, sine] = [Math.cos(radians(state.turn)), Math.sin(radians(state.turn))];
  return { target: [state.target[0] + cosine * right - sine * up, state.target[1] + sine * right + cosine * up] };
}

function listen(viewer) {
  const { canvas } = viewer;
  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const [x, y] = [event.clientX - before[0], event.clientY - before[1]];
    const apart = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const { state } = viewer;
    const side = Math.min(canvas.clientWidth, canvas.clientHeight);
    const moved = (2 * viewer.content.shapes.spread * state.distance) / side;
    if (fingers.size === 2) {
      const own = state.shape === "plane" ? shifted(state, (-moved * x) / 2, (moved * y) / 2) : {};
      viewer.set({ ...own, distance: (state.distance * apart) / Math.max(spread(), 1) });
    } else if (event.altKey) viewer.set({ lightTurn: state.lightTurn + x / 3, lightTilt: state.lightTilt - y / 3 });
    else if (event.shiftKey && state.shape === "plane") viewer.set(shifted(state, -moved * x, moved * y));
    else viewer.set({ turn: state.turn - x / 3, tilt: state.tilt + y / 3 });
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    viewer.set({ distance: viewer.state.distance * Math.exp(within(event.deltaY, -240, 240) / 800) });
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const { state } = viewer;
    const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [0, 0];
    const others = { "+": { distance: state.distance / 1.15 }, "=": { distance: state.distance / 1.15 },
      "-": { distance: state.distance * 1.15 }, "[": { wipe: state.wipe - 0.02 }, "]": { wipe: state.wipe + 0.02 } };
    const turned = event.shiftKey ? { lightTurn: state.lightTurn + 5 * x, lightTilt: state.lightTilt + 5 * y }
      : { turn: state.turn + 3 * x, tilt: state.tilt + 3 * y };
    const changes = x || y ? turned : others[event.key];
    if (!changes || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    viewer.set(changes);
  });
  new ResizeObserver(() => { if (viewer.resized) viewer.draw(); }).observe(canvas);
  canvas.addEventListener("webglcontextlost", () => {
    byId("notice").textContent = "The graphics device was lost; load this page again.";
  });
}

async function start() {
  try {
    for (let n = 0; n < 2; n += 1) await nextFrame(); // the still picture is seen first
    const sources = Object.fromEntries(["points", "nodes"].map((name) => [name, byId(name).textContent]));
    const viewer = new Viewer(JSON.parse(byId("content").textContent), sources);
    const updates = [];
    const input = (element, changes) => element.addEventListener("input", () => viewer.set(changes()));
    const bind = { updates, input };
    makeRanges(viewer, bind);
    makeChoices(viewer, bind);
    makePad(viewer, bind);
    viewer.shown = (state) => {
      const own = LIMITS[state.shape];
      for (const [name, title] of [["tilt", "Tilt"], ["turn", "Turn"]]) {
        const input = document.querySelector(`[data-name="${title}"]`);
        [input.min, input.max] = own[name];
      }
      updates.forEach((update) => update(state));
    };
    listen(viewer);
    window.viewer = viewer;
    await viewer.set({});
  } catch (error) {
    document.body.className = "still";
    byId("notice").textContent = `This is a still picture: ${error.message}`;
  }
}

start();
