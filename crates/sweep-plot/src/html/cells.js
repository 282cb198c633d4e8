// The values of a map's cells, decoded, and what is asked of them.

// The code of a cell whose points differ.
const SEVERAL_WORDS = 254;

function createCells(data) {
  const columns = {};
  for (const [name, column] of Object.entries(data.columns)) {
    columns[name] = { ...column, values: floats(column.data) };
  }
  const codes = {};
  for (const [name, coded] of Object.entries(data.codes)) {
    codes[name] = { ...coded, values: decode(coded.data) };
  }
  const word = (name, cell) => codes[name]?.words[codes[name].values[cell]] ?? null;
  // How many points of a cell are what; where each cell is one point, its words say so.
  const counted = (name, holds) => (data.counts ? floats(data.counts[name])
    : Uint8Array.from(codes.status.values, (_, cell) => holds(cell)));
  const status = (cell) => word("status", cell);
  const counts = {
    points: counted("points", (cell) => status(cell) !== null),
    failed: counted("failed", (cell) => status(cell) !== null && status(cell) !== "ok"),
    reliable: counted("reliable", (cell) => word("reliable", cell) === "true"),
    unreliable: counted("unreliable", (cell) => word("reliable", cell) === "false"),
    sensitive: counted("sensitive", (cell) => word("sensitive", cell) === "true"),
  };
  // Cells of several points with some on either side of a layer's level, and with some that did not
  // fail and yet have no value.
  for (const layer of data.layers) {
    for (const name of ["both", "undefined"]) if (layer[name]) layer[name] = decode(layer[name]);
  }
  const wordsOf = (channel) => data.rows.find((row) => row.name === channel)?.words
    ?? channel.replaceAll("_", " ");
  const bit = (bits, cell) => bits !== undefined && ((bits[cell >> 3] >> (cell & 7)) & 1) === 1;
  const filled = (cell) => counts.points[cell] > 0;
  // Whether any point of a cell failed.
  const failed = (cell) => counts.failed[cell] > 0;
  const hasValue = (layer, cell) => {
    const value = columns[layer.column].values[cell];
    return Number.isFinite(value) && (layer.group !== "ratio" || value > 0);
  };
  // Points that failed or have no value beside others that have one.
  const partlyLost = (layer, cell) => hasValue(layer, cell)
    && (failed(cell) || bit(layer.undefined, cell));
  // Cells whose colour depends on a motion that is chaotic.
  const sensitive = (layer, cell) => layer.nonlinear && counts.sensitive[cell] > 0;
  // What a cell says of the linear model, in words.
  function verdict(cell) {
    if (!filled(cell)) return "not in the file";
    const points = counts.points[cell];
    const [reliable, unreliable, lost] = ["reliable", "unreliable", "failed"]
      .map((kind) => counts[kind][cell]);
    const kinds = [[reliable, "reliable"], [unreliable, "unreliable"], [lost, "failed"],
      [points - reliable - unreliable - lost, "undefined"]].filter(([count]) => count > 0);
    if (kinds.length > 1) return kinds.map(([count, kind]) => `${count} ${kind}`).join(", ");
    const ended = points === 1 ? `: ${status(cell)?.replaceAll("_", " ")}` : "";
    const said = { reliable: "linear model reliable", unreliable: "linear model unreliable",
      failed: `failed${ended}`, undefined: "undefined: no excitation" }[kinds[0][1]];
    return points === 1 ? said : `${said} at all ${points} points`;
  }

  // Places of a cell along all axes.
  const placesOf = (cell) => data.axes.reduceRight(([left, ...found], { values }) => [
    Math.floor(left / values.length), left % values.length, ...found], [cell]).slice(1);
  const valuesOf = (cell) => placesOf(cell).map((place, k) => data.axes[k].values[place]);

  return { columns, codes, word, counts, wordsOf, bit, filled, failed, hasValue, partlyLost,
    placesOf, sensitive, valuesOf, verdict };
}
