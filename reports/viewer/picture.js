// Pictures by WebGL 2: the shader, its textures, and the camera.

const CORNERS = `#version 300 es
void main() { gl_Position = vec4(4 * (gl_VertexID % 2) - 1, 4 * (gl_VertexID / 2) - 1, 0, 1); }`;
const SHAPES = ["plane", "sphere", "drape"];
const NODES = 0;
const POINT = 1;
const TILE = 2;

function direction(turn, tilt) {
  const [a, b] = [radians(turn), radians(tilt)];
  return [Math.sin(a) * Math.cos(b), -Math.cos(a) * Math.cos(b), Math.sin(b)];
}

class Picture {
  // `sources`: shaders that draw points and tiles, and soft nodes.
  constructor(canvas, sources, content) {
    this.content = content;
    this.sources = sources;
    this.programs = new Map();
    this.opened = new Map();
    this.tiles = new Map();
    const options = { alpha: true, antialias: false, depth: false, preserveDrawingBuffer: true };
    const gl = canvas.getContext("webgl2", options);
    if (!gl) throw new Error("This browser has no WebGL 2.");
    this.gl = gl;
    this.floats = gl.getExtension("EXT_color_buffer_float") !== null;
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, gl.createBuffer());
    this.target = gl.createFramebuffer();
    this.empty = this.texture("tile", new Uint16Array(4), 1);
    this.known = new Map();
    this.use(POINT);
  }

  // Draw by the program of a kind of method; it is compiled when it is first needed.
  use(kind) {
    const name = kind === NODES ? "nodes" : "points";
    if (!this.programs.has(name)) this.programs.set(name, this.compiled(this.sources[name]));
    this.gl.useProgram(this.programs.get(name));
  }

  // Whether the shader of a kind of method compiles on this device, found once.
  knows(kind) {
    if (!this.known.has(kind)) {
      try {
        this.use(kind);
        this.known.set(kind, true);
      } catch {
        this.known.set(kind, false);
      }
    }
    return this.known.get(kind);
  }

  compiled(source) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, CORNERS], [gl.FRAGMENT_SHADER, source]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      throw new Error(`The shader does not compile here. ${gl.getProgramInfoLog(program) || ""}`);
    }
    gl.useProgram(program);
    ["integers", "numbers", "nodes", "grid", "tile"].forEach((name, unit) => {
      gl.uniform1i(gl.getUniformLocation(program, `${name}_0`), unit);
    });
    gl.uniformBlockBinding(program, gl.getUniformBlockIndex(program, "block_View_0"), 0);
    return program;
  }

  // A texture of `width` texels a row, the last row filled up.
  texture(name, values, width = this.content.texture_width) {
    const { gl } = this;
    const [format, channels, type, count] = {
      integers: [gl.R32I, gl.RED_INTEGER, gl.INT, 1],
      numbers: [gl.R32F, gl.RED, gl.FLOAT, 1],
      nodes: [gl.RGBA32F, gl.RGBA, gl.FLOAT, 4],
      grid: [gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE, 1],
      tile: [gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT, 4],
    }[name];
    const height = Math.ceil(values.length / count / width);
    const whole = new values.constructor(width * height * count);
    whole.set(values);
    const made = gl.createTexture();
    gl.activeTexture(gl.TEXTURE7);
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, channels, type, whole);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return made;
  }

  // The table of a shape and level, or undefined if the page has none.
  indexOf(state, level) {
    const { bends, widths, tables } = this.content;
    const found = tables.findIndex((table) => table.level === level && table.bend === bends[state.bend]
      && table.width === widths[state.width]);
    return found < 0 ? undefined : found;
  }

  async open(index) {
    if (!this.opened.has(index)) {
      this.opened.set(index, openTable(this.content, index).then((table) => ({
        table,
        edit: "",
        integers: this.texture("integers", table.integers),
        grid: this.texture("grid", table.grid),
      })));
    }
    return this.opened.get(index);
  }

  // Everything that pictures of a state by these methods read, ready to be bound.
  async prepare(state, methods) {
    const ready = [];
    for (const method of methods) {
      let tile = this.empty;
      if (method.kind === TILE) {
        const { size, tiles } = this.content.views[method.view];
        const name = `${method.view} ${method.tile}`;
        if (!this.tiles.has(name)) {
          this.tiles.set(name, unpacked(tiles[method.tile], Uint16Array).then((f) => this.texture("tile", f, size)));
        }
        tile = await this.tiles.get(name);
      }
      const cloth = await this.open(this.indexOf(state, method.level));
      const yarns = [state.warp, state.weft];
      const edit = JSON.stringify([yarns, state.thickness]);
      if (cloth.edit !== edit) {
        [cloth.numbers, cloth.nodes].forEach((old) => this.gl.deleteTexture(old ?? null));
        const { columns } = this.content;
        cloth.numbers = this.texture("numbers", editedNumbers(cloth.table, columns, yarns, state.thickness));
        cloth.nodes = this.texture("nodes", turnedNodes(cloth.table, columns, yarns));
        cloth.edit = edit;
      }
      ready.push({ ...method, cloth, texture: tile });
    }
    return ready;
  }

  // The numbers of `View` in `cloth.slang`, four a field.
  view(state, kind, width, height, components) {
    const { radius, spread, arcs, half_arc: half, half_height: halfHeight } = this.content.shapes;
    const toward = direction(state.turn, state.tilt);
    const right = [Math.cos(radians(state.turn)), Math.sin(radians(state.turn)), 0];
    const up = [toward[1] * right[2] - toward[2] * right[1], toward[2] * right[0] - toward[0] * right[2],
      toward[0] * right[1] - toward[1] * right[0]];
    const front = -arcs[arcs.length / 2][1] * (1 - Math.cos(half));
    const middle = {
      plane: [...state.target, 0], sphere: toward.map((value) => radius * value), drape: [0, front, 0],
    }[state.shape];
    const step = (2 * spread) / Math.min(width, height);
    const irradiance = this.content.irradiance * 2 ** state.exposure;
    const four = (values, last = 0) => [...values, last];
    return new Float32Array([
      four(toward.map((value, axis) => middle[axis] + state.distance * value)),
      four(toward.map((value) => -value)),
      four(right.map((value) => step * value)),
      four(up.map((value) => step * value)),
      [width / 2, height / 2, 0, 0],
      four(direction(state.lightTurn, state.lightTilt)),
      [irradiance, irradiance, irradiance, 0],
      ...state.colours.map((colour) => four(colour)),
      [SHAPES.indexOf(state.shape), kind, components ? 1 : 0, radius],
      [Math.cos(half), Math.sin(half), halfHeight, this.content.through ? 1 : 0],
      ...arcs,
    ].flat());
  }

  // Draw rows of a picture by what `prepare` has made ready, [left, right), parted at the column `wipe`.
  draw(state, ready, size, rows, wipe, components = false) {
    const { gl } = this;
    const [width, height] = size;
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    ready.forEach(({ kind, cloth, texture: tile }, side) => {
      const [low, high] = ready.length === 1 ? [0, width] : side === 0 ? [0, wipe] : [wipe, width];
      if (high <= low) return;
      gl.scissor(low, rows[0], high - low, rows[1] - rows[0]);
      this.use(kind);
      [cloth.integers, cloth.numbers, cloth.nodes, cloth.grid, tile].forEach((texture, unit) => {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, texture);
      });
      gl.bufferData(gl.UNIFORM_BUFFER, this.view(state, kind, width, height, components), gl.DYNAMIC_DRAW);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    });
    gl.disable(gl.SCISSOR_TEST);
  }

  // Let further pictures go to a texture of this size; null: to the canvas.
  aim(size, components = false) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, size ? this.target : null);
    if (!size) return;
    gl.deleteTexture(this.drawn ?? null);
    this.drawn = gl.createTexture();
    gl.activeTexture(gl.TEXTURE7);
    gl.bindTexture(gl.TEXTURE_2D, this.drawn);
    gl.texStorage2D(gl.TEXTURE_2D, 1, components ? gl.RGBA32F : gl.RGBA8, ...size);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.drawn, 0);
  }

  // Show the texture of `aim` on the canvas, in a rectangle.
  show(size, [left, low, right, high], smooth) {
    const { gl } = this;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.target);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, ...size, left, low, right, high, gl.COLOR_BUFFER_BIT, smooth ? gl.LINEAR : gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  // Draw a small picture and show it on the canvas, in a box; returns its milliseconds. A first row is not timed: drivers
  // compile what they draw with then.
  async small(state, ready, size, wipe, box, smooth) {
    const draw = (rows) => {
      this.aim(size);
      this.draw(state, ready, size, rows, wipe);
    };
    await this.timed(() => draw([0, 1]));
    return this.timed(() => {
      draw([0, size[1]]);
      this.show(size, box, smooth);
    });
  }

  // Milliseconds until what a function draws is done; the page answers meanwhile.
  async timed(work) {
    const { gl } = this;
    const began = performance.now();
    work();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    while (fence && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) await new Promise((done) => { setTimeout(done); });
    gl.deleteSync(fence);
    return Math.max(performance.now() - began, 0.1); // clocks may be coarse
  }

  // Components of a square picture by one method, row 0 the lowest, -1 where there is no cloth.
  async components(state, method, size) {
    const ready = await this.prepare(state, [method]);
    const found = new Float32Array(4 * size * size);
    this.aim([size, size], true);
    this.draw(state, ready, [size, size], [0, size], 0, true);
    this.gl.readPixels(0, 0, size, size, this.gl.RGBA, this.gl.FLOAT, found);
    this.aim(null);
    return found;
  }
}
