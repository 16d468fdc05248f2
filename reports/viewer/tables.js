// Buffers of cloths: unpacked, and edited where an edit needs no new horizons.

async function unpacked(text, Numbers) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Numbers(await new Response(stream).arrayBuffer());
}

async function openTable(content, index) {
  const table = content.tables[index];
  const [integers, numbers, nodes, families, horizons, walls] = await Promise.all([
    unpacked(table.integers, Int32Array),
    unpacked(table.numbers, Float32Array),
    unpacked(table.nodes, Float32Array),
    unpacked(table.families, Uint8Array),
    unpacked(content.grids[table.grid], Uint8Array),
    unpacked(table.end_walls, Uint8Array),
  ]);
  const grid = new Uint8Array(horizons.length + walls.length);
  grid.set(horizons);
  grid.set(walls, horizons.length);
  return { ...table, integers, numbers, nodes, families, grid };
}

const radians = (degrees) => (degrees * Math.PI) / 180;

// Roughness, twist and weight of the yarn's normal of warp and weft, and the optical thickness: columns of the table.
function editedNumbers(table, columns, yarns, thickness) {
  const numbers = table.numbers.slice();
  yarns.forEach((yarn, family) => {
    const row = table.yarn + table.yarn_columns * family;
    numbers[row + columns.sin] = Math.sin(radians(yarn.twist));
    numbers[row + columns.cos] = Math.cos(radians(yarn.twist));
    numbers[row + columns.roughness] = yarn.roughness;
    numbers[row + columns.blend] = yarn.blend;
  });
  numbers[table.thickness] = thickness;
  return numbers;
}

// The fibre's tangent T at a place of a yarn and its derivatives along and across the yarn, as in `soft_nodes.slang`.
function fibre(a, twist, relief) {
  const sine = Math.sin(twist);
  const cosine = Math.cos(twist);
  const t = [-a.cosV * sine, a.cosU * cosine + a.sinU * a.sinV * sine,
    relief * (a.cosU * a.sinV * sine - a.sinU * cosine)];
  const length = Math.hypot(...t);
  const unit = t.map((value) => value / length);
  const turning = (d) => {
    const along = d[0] * unit[0] + d[1] * unit[1] + d[2] * unit[2];
    return d.map((value, axis) => (value - along * unit[axis]) / length);
  };
  const byU = turning([0, a.cosU * a.sinV * sine - a.sinU * cosine,
    -relief * (a.cosU * cosine + a.sinU * a.sinV * sine)]);
  const byV = turning([a.sinV * sine, a.sinU * a.cosV * sine, relief * a.cosU * a.cosV * sine]);
  return { unit, byU, byV };
}

// Nodes whose fibres have another twist. The normal says where a node is on its yarn; how far its box reaches along and
// across is the ratio of the stored change of the tangent to the one at a box of 1.
function turnedNodes(table, columns, yarns) {
  const nodes = table.nodes.slice();
  const changed = yarns.map((yarn, family) => Math.abs(yarn.twist - table.twists[family]) > 1e-6);
  table.families.forEach((family, index) => {
    if (!changed[family]) return;
    const row = 4 * table.stride * index;
    const relief = table.numbers[table.yarn + table.yarn_columns * family + columns.relief];
    const n = [nodes[row] / relief, nodes[row + 1] / relief, nodes[row + 2]];
    const size = Math.hypot(...n);
    const cosV = Math.hypot(n[1], n[2]) / size;
    const a = { sinV: n[0] / size, cosV, sinU: n[1] / size / cosV, cosU: n[2] / size / cosV };
    const old = fibre(a, radians(table.twists[family]), relief);
    const next = fibre(a, radians(yarns[family].twist), relief);
    nodes.set(next.unit, row + 4);
    [[8, old.byU, next.byU], [12, old.byV, next.byV]].forEach(([column, before, after]) => {
      const stored = Math.hypot(nodes[row + column], nodes[row + column + 1], nodes[row + column + 2]);
      const sense = Math.sign(before[0] * nodes[row + column] + before[1] * nodes[row + column + 1]
        + before[2] * nodes[row + column + 2]);
      const reach = (sense * stored) / Math.hypot(...before);
      after.forEach((value, axis) => { nodes[row + column + axis] = reach * value; });
    });
  });
  return nodes;
}
