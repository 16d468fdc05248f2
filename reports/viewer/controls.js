// State, controls, pointers and keys, and when to draw what.

const byId = (name) => document.getElementById(name);
const within = (value, low, high) => Math.min(Math.max(value, low), high);
const toLinear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
const toSrgb = (c) => (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055);
const code = (c) => Math.round(255 * toSrgb(within(c, 0, 1))).toString(16).padStart(2, "0");
const hex = (rgb) => `#${rgb.map(code).join("")}`;
const linear = (text) => [1, 3, 5].map((at) => toLinear(parseInt(text.slice(at, at + 2), 16) / 255));
const rounded = (value, digits = 2) => `${Number(value.toPrecision(digits))}`; // never in powers of ten
const percent = (share) => `${rounded(100 * share)} %`;

const LIMITS = { plane: { tilt: [2, 89], turn: [-180, 180] }, sphere: { tilt: [-75, 80], turn: [-180, 180] },
  drape: { tilt: [-35, 60], turn: [-75, 75] } };
const YARN = { roughness: ["Roughness", 0.05, 1, 0.01, ""], twist: ["Twist", -60, 60, 1, "°"],
  blend: ["Normal’s weight", 0, 1, 0.01, ""] };
const TILES = { truth: "Truth", flat: "Truth, flat footprints", map_material: "Map material" };
const FRAME = 1000 / 30;
const MOST_PIXELS = 1.6e6;
const ERROR_SIZE = 128;

class Viewer {
  constructor(content, source) {
    this.content = content;
    this.canvas = byId("cloth");
    this.picture = new Picture(this.canvas, source, content);
    this.levels = content.tables.filter((table) => table.bend === 1 && table.width === 1).map((table) => table.level);
    this.usual = this.levels.includes(2) ? 2 : this.levels[0];
    this.scale = 0.5;
    this.rows = 64;
    this.drawn = Promise.resolve();
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
    return this.go(content.views.length - 1);
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
  set(changes, dragging = false) {
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
    return this.draw(dragging);
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
    if (name === "selvage" && this.own && this.picture.knows(SELVAGE)) {
      return { kind: SELVAGE, level: this.content.selvage.level, label: "Selvage" };
    }
    if (name === "point" || !this.picture.knows(NODES)) {
      return { kind: POINT, level: this.usual, label: "One point" };
    }
    const wished = name === "truth" ? Math.max(...this.levels) : Number(name) || this.usual;
    const level = this.picture.indexOf(state, wished) === undefined ? this.usual : wished;
    return { kind: NODES, level, label: `Soft nodes, k = ${level}` };
  }

  get methods() { return [this.method(this.state.left), this.method(this.state.right)]; }

  draw(dragging) {
    this.dragging = dragging;
    this.job = (this.job ?? 0) + 1;
    const { job } = this;
    clearTimeout(this.settling);
    this.drawn = new Promise((resolve, reject) => {
      requestAnimationFrame(() => this.frame(job).then(resolve, reject));
    });
    return this.drawn;
  }

  // Draw once: small while dragging, else in full, a strip at a time so that the page keeps answering.
  async frame(job) {
    if (job !== this.job) return;
    const { picture, canvas, methods } = this;
    const tiled = methods.some((method) => method.kind === TILE);
    const { state } = this;
    const ready = await picture.prepare(state, methods);
    if (job !== this.job) return;
    this.fit();
    this.label(methods);
    const whole = [canvas.width, canvas.height];
    if (tiled) {
      const { size } = this.content.views[state.view];
      const side = Math.min(...whole);
      const corner = whole.map((length) => (length - side) >> 1);
      const wipe = Math.round(within((whole[0] * state.wipe - corner[0]) / side, 0, 1) * size);
      picture.aim(null);
      picture.gl.clear(picture.gl.COLOR_BUFFER_BIT);
      const box = [...corner, ...corner.map((low) => low + side)];
      this.time(() => this.small(state, ready, [size, size], wipe, box, false), [size, size]);
      this.settle(job);
      return;
    }
    if (this.dragging) {
      const size = whole.map((length) => Math.max(16, Math.round(length * this.scale)));
      const box = [0, 0, ...whole];
      const spent = this.time(() => this.small(state, ready, size, Math.round(size[0] * state.wipe), box, true), size);
      this.scale = within(this.scale * Math.sqrt(FRAME / spent), 0.08, 1);
      this.settling = setTimeout(() => { this.draw(false); }, 250);
      return;
    }
    let spent = 0;
    let row = 0;
    while (row < whole[1]) {
      if (row > 0) await new Promise(requestAnimationFrame);
      if (job !== this.job) return;
      const rows = [row, Math.min(row + this.rows, whole[1])];
      const began = performance.now();
      picture.aim(null);
      picture.draw(state, ready, whole, rows, Math.round(whole[0] * state.wipe));
      picture.wait();
      const own = performance.now() - began;
      spent += own;
      if (rows[1] < whole[1]) this.rows = Math.round(within(this.rows * FRAME / own, 4, whole[1]));
      [, row] = rows;
    }
    this.tell(spent, whole);
    this.settle(job);
  }

  small(state, ready, size, wipe, box, smooth) {
    const { picture } = this;
    picture.aim(size);
    picture.draw(state, ready, size, [0, size[1]], wipe);
    picture.show(size, box, smooth);
    picture.wait();
  }

  time(work, size) {
    const began = performance.now();
    work();
    const spent = Math.max(performance.now() - began, 0.1);
    this.tell(spent, size);
    return spent;
  }

  tell(spent, [width, height]) {
    const rate = 1000 / Math.max(spent, 0.1); // clocks may be coarse
    byId("speed").textContent = `${rounded(rate, rate < 10 ? 2 : 3)} frames/s at ${width} × ${height}`;
  }

  // Keep the canvas as large as it is shown, within a limit.
  fit() {
    const { canvas } = this;
    const shown = canvas.getBoundingClientRect();
    const ratio = Math.min(devicePixelRatio, Math.sqrt(MOST_PIXELS / Math.max(shown.width * shown.height, 1)));
    const [width, height] = [shown.width, shown.height].map((length) => Math.max(1, Math.round(length * ratio)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  }

  label(methods) {
    const { state, content } = this;
    ["left", "right"].forEach((side, index) => { byId(`label-${side}`).textContent = methods[index].label; });
    const names = [...new Set([state.left, state.right])];
    const said = names.filter((name) => name in TILES && !this.tiled(name)).map((name) => {
      const known = content.views.filter((view) => name in (view.tiles ?? {})).map((view) => view.name);
      return `${TILES[name]}: known at ${known.join(", ")} alone, of the yarns as they are.`;
    });
    if (names.includes("selvage")) {
      if (!this.own) said.push("Selvage: known of the yarns as they are.");
      else if (!this.picture.knows(SELVAGE)) said.push("Selvage: its shader does not compile here.");
    }
    if (names.some((name) => name !== "point" && !this.tiled(name)) && !this.picture.knows(NODES)) {
      said.push("Soft nodes: their shader does not compile here. One point is shown instead.");
    } else if (said.length) said.push("Soft nodes are shown instead.");
    byId("notice").textContent = said.join(" ");
    byId("line").style.left = `${100 * state.wipe}%`;
    const size = (2 * this.content.shapes.spread * state.distance) / Math.min(this.canvas.width, this.canvas.height);
    byId("footprint").textContent = `${rounded(size)} yarns, in the middle`;
  }

  // When nothing has changed for a while: errors.
  settle(job) {
    if (!this.picture.floats) byId("error").textContent = "not on this device";
    else this.settling = setTimeout(() => { if (job === this.job) this.measure(); }, 400);
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
      await new Promise(requestAnimationFrame);
      if (job !== this.job) return;
    }
    if (view) {
      const errors = found.slice(0, 2).map((picture) => percent(this.difference(picture, found[2])));
      byId("error-name").textContent = "Error, share of the mean: left, right (truth itself)";
      byId("error").textContent = `${errors.join(", ")} (${percent(view.standard_error)})`;
    } else {
      byId("error-name").textContent = "Left differs from right, share of the mean";
      byId("error").textContent = percent(this.difference(found[0], found[1]));
    }
  }

  // Milliseconds of a picture of `size` pixels along each side by a method: the median of several.
  async timed(name, size, times = 3) {
    const method = this.method(name);
    const ready = await this.picture.prepare(this.state, [method]);
    const spent = [];
    for (let n = 0; n < times; n += 1) {
      this.picture.aim([size, size]);
      this.picture.wait();
      const began = performance.now();
      this.picture.draw(this.state, ready, [size, size], [0, size], 0);
      this.picture.wait();
      spent.push(performance.now() - began);
    }
    this.picture.aim(null);
    return spent.sort((a, b) => a - b)[times >> 1];
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
    let text = "percent" in place.dataset ? (value) => `${Math.round(100 * value)} %` : (value) => digits(value) + unit;
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
    [["diffuse", 2 + index], ["gloss", index]].forEach(([kind, component]) => {
      const label = head.appendChild(document.createElement("label"));
      label.className = "colour";
      label.append(kind);
      const input = label.appendChild(document.createElement("input"));
      input.type = "color";
      input.setAttribute("aria-label", `${title}, ${kind} colour`);
      input.dataset.name = `${title}, ${kind} colour`;
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
  for (const input of document.querySelectorAll("[name=shape]")) {
    input.addEventListener("change", () => {
      viewer.go(viewer.content.views.findIndex((view) => view.shape === input.value));
    });
    bind.updates.push((state) => { input.checked = state.shape === input.value; });
  }
  const names = [["point", "One point"], ...viewer.levels.map((level) => [String(level), `Soft nodes, k = ${level}`])];
  if (viewer.content.selvage) names.push(["selvage", "Selvage"]);
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
    viewer.set({ lightTurn: (Math.atan2(x, y) * 180) / Math.PI, lightTilt: 90 * (1 - far) }, true);
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
    if (fingers.size === 2) viewer.set({ distance: (state.distance * apart) / Math.max(spread(), 1) }, true);
    else if (event.altKey) viewer.set({ lightTurn: state.lightTurn + x / 3, lightTilt: state.lightTilt - y / 3 }, true);
    else if (event.shiftKey && state.shape === "plane") viewer.set(shifted(state, -moved * x, moved * y), true);
    else viewer.set({ turn: state.turn - x / 3, tilt: state.tilt + y / 3 }, true);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    viewer.set({ distance: viewer.state.distance * Math.exp(within(event.deltaY, -240, 240) / 800) }, true);
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
    viewer.set(changes, true);
  });
  const grip = document.querySelector("#line i");
  grip.addEventListener("pointerdown", (event) => grip.setPointerCapture(event.pointerId));
  grip.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect();
    if (event.buttons) viewer.set({ wipe: (event.clientX - box.left) / box.width }, true);
  });
  new ResizeObserver(() => viewer.draw(false)).observe(canvas);
  canvas.addEventListener("webglcontextlost", () => {
    byId("notice").textContent = "The graphics device was lost; load this page again.";
  });
}

async function start() {
  try {
    const sources = Object.fromEntries(["points", "nodes", "selvage"].map((name) => [name, byId(name).textContent]));
    const viewer = new Viewer(JSON.parse(byId("content").textContent), sources);
    const updates = [];
    const input = (element, changes) => element.addEventListener("input", () => viewer.set(changes(), true));
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
    document.body.classList.add("drawn");
  } catch (error) {
    document.body.classList.add("still");
    byId("notice").textContent = `This is a still picture: ${error.message}`;
  }
}

start();
