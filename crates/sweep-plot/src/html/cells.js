// The values of a map's cells, decoded, and what is asked of them.

// Codes of a cell without a word, and of one whose points differ.
const [NO_WORD, SEVERAL_WORDS] = [255, 254];

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
  const counts = data.counts
    && Object.fromEntries(Object.entries(data.counts).map(([name, text]) => [name, floats(text)]));
  // Cells of several points with some on either side of a layer's level, and with some that did not
  // fail and yet have no value.
  for (const layer of data.layers) {
    for (const name of ["both", "undefined"]) if (layer[name]) layer[name] = decode(layer[name]);
  }
  const wordsOf = Object.fromEntries(data.rows.map((row) => [row.name, row.words]));
  const bit = (bits, cell) => bits !== undefined && ((bits[cell >> 3] >> (cell & 7)) & 1) === 1;
  // Whether the file has a point in a cell, and whether any of its points failed.
  const filled = (cell) => (counts
    ? counts.points[cell] > 0 : codes.status.values[cell] !== NO_WORD);
  const failed = (cell) => (counts ? counts.failed[cell] > 0 : word("status", cell) !== "ok");
  const hasValue = (layer, cell) => {
    const value = columns[layer.column].values[cell];
    return Number.isFinite(value) && (layer.group !== "ratio" || value > 0);
  };
  // Without any value, because of points that failed.
  const isLost = (layer, cell) => filled(cell) && failed(cell) && !hasValue(layer, cell);
  // Points that failed or have no value beside others that have one.
  const partlyLost = (layer, cell) => counts !== undefined && hasValue(layer, cell)
    && (counts.failed[cell] > 0 || bit(layer.undefined, cell));
  // Cells whose colour depends on a motion that is chaotic.
  const sensitive = (layer, cell) => layer.nonlinear
    && (counts ? counts.sensitive[cell] > 0 : word("sensitive", cell) === "true");
  // What a cell says of the linear model, in words.
  function verdict(cell) {
    if (!filled(cell)) return "not in the file";
    const points = counts?.points[cell] ?? 1;
    if (points > 1) {
      const [reliable, unreliable, lost] = ["reliable", "unreliable", "failed"]
        .map((kind) => counts[kind][cell]);
      const kinds = [[reliable, "reliable"], [unreliable, "unreliable"], [lost, "failed"],
        [points - reliable - unreliable - lost, "undefined"]].filter(([count]) => count > 0);
      if (kinds.length > 1) return kinds.map(([count, kind]) => `${count} ${kind}`).join(", ");
      const said = { reliable: "linear model reliable", unreliable: "linear model unreliable",
        failed: "failed", undefined: "undefined: no excitation" }[kinds[0][1]];
      return `${said} at all ${points} points`;
    }
    const reliable = word("reliable", cell);
    if (reliable !== null) return `linear model ${reliable === "true" ? "" : "un"}reliable`;
    const status = word("status", cell) ?? "unknown";
    const ended = status.replaceAll("_", " ");
    return status === "ok" ? "undefined: no excitation" : `failed: ${ended}`;
  }

  return { columns, codes, word, counts, wordsOf, bit, filled, failed, hasValue, isLost,
    partlyLost, sensitive, verdict };
}
