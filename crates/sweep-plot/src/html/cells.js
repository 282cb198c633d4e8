// The decoded values of a map's cells, and functions that evaluate them.

// The code of a cell whose points have different words.
const SEVERAL_WORDS = 254;

function createCells(data) {
  const columns = {};
  for (const [name, column] of Object.entries(data.columns)) {
    columns[name] = { ...column, values: decodeFloats(column.data) };
  }
  const codes = {};
  for (const [name, column] of Object.entries(data.codes)) {
    codes[name] = { ...column, values: decode(column.data) };
  }
  const word = (name, cell) => codes[name]?.words[codes[name].values[cell]] ?? null;
  // Returns the number of a kind of points in each cell. For cells of one point it follows from the
  // cell's words.
  const pointCounts = (name, isCounted) => (data.counts ? decodeFloats(data.counts[name])
    : Uint8Array.from(codes.status.values, (_, cell) => isCounted(cell)));
  const status = (cell) => word("status", cell);
  const counts = {
    points: pointCounts("points", (cell) => status(cell) !== null),
    failed: pointCounts("failed", (cell) => status(cell) !== null && status(cell) !== "ok"),
    reliable: pointCounts("reliable", (cell) => word("reliable", cell) === "true"),
    unreliable: pointCounts("unreliable", (cell) => word("reliable", cell) === "false"),
    sensitive: pointCounts("sensitive", (cell) => word("sensitive", cell) === "true"),
  };
  // Bits of the cells that have points on both sides of a layer's limit, and of those that have
  // points without a value that did not fail.
  for (const layer of data.layers) {
    for (const name of ["both", "undefined"]) if (layer[name]) layer[name] = decode(layer[name]);
  }
  const wordsOf = (channel) => data.rows.find((row) => row.name === channel)?.words
    ?? channel.replaceAll("_", " ");
  const isBitSet = (bits, cell) => bits !== undefined
    && ((bits[cell >> 3] >> (cell & 7)) & 1) === 1;
  const isFilled = (cell) => counts.points[cell] > 0;
  // Returns whether any point of a cell failed.
  const hasFailed = (cell) => counts.failed[cell] > 0;
  const hasValue = (layer, cell) => {
    const value = columns[layer.column].values[cell];
    return Number.isFinite(value) && (layer.group !== "ratio" || value > 0);
  };
  // Returns whether a cell has points that failed or have no value beside others with a value.
  const hasMissingValues = (layer, cell) => hasValue(layer, cell)
    && (hasFailed(cell) || isBitSet(layer.undefined, cell));
  // Returns whether a cell's colour depends on a chaotic motion.
  const isSensitive = (layer, cell) => layer.nonlinear && counts.sensitive[cell] > 0;
  // Returns the verdict of a cell in words.
  function verdict(cell) {
    if (!isFilled(cell)) return "not in the file";
    const points = counts.points[cell];
    const [reliable, unreliable, failed] = ["reliable", "unreliable", "failed"]
      .map((kind) => counts[kind][cell]);
    const kinds = [[reliable, "reliable"], [unreliable, "unreliable"], [failed, "failed"],
      [points - reliable - unreliable - failed, "undefined"]].filter(([count]) => count > 0);
    if (kinds.length > 1) return kinds.map(([count, kind]) => `${count} ${kind}`).join(", ");
    const statusNote = points === 1 ? `: ${status(cell)?.replaceAll("_", " ")}` : "";
    const description = { reliable: "linear model reliable", unreliable: "linear model unreliable",
      failed: `failed${statusNote}`, undefined: "undefined: no excitation" }[kinds[0][1]];
    return points === 1 ? description : `${description} at all ${points} points`;
  }

  // Returns the indices of a cell along all axes.
  const placesOf = (cell) => data.axes.reduceRight(([remaining, ...places], { values }) => [
    Math.floor(remaining / values.length), remaining % values.length, ...places], [cell]).slice(1);
  const valuesOf = (cell) => placesOf(cell).map((place, k) => data.axes[k].values[place]);

  return { columns, codes, word, counts, wordsOf, isBitSet, isFilled, hasFailed, hasValue,
    hasMissingValues, placesOf, isSensitive, valuesOf, verdict };
}
