// The report part of a map's page: all points in a table, the worst of the quantity shown first,
// and downloads.

// Number of rows of the table that are added at a time.
const ROWS_AT_ONCE = 20;

function createReport(host, data, map, panel) {
  const { columns, filled, word, wordsOf, verdict, valuesOf, shownValue } = map.cells;
  const all = Array.from({ length: columns.point.values.length }, (_, cell) => cell)
    .filter(filled);

  const find = furnish(host, "report");
  const said = find("#taken");
  for (const take of [link, picture, numbers]) {
    find(`#${take.name}`).addEventListener("click", take);
  }
  createTable();

  function createTable() {
    const heads = ["", ...data.axes.map((axis) => withUnit(axis.words, axis.unit)), "",
      "Largest ratio", "in", "Verdict"];
    const find = furnish(document.getElementById("about"), "points");
    const [title, more] = [find("h2:last-of-type"), find("#more")];
    more.addEventListener("click", extend);
    const made = table(heads, [], { id: "points" });
    more.before(made);
    const [body, shownHead] = [made.tBodies[0], made.rows[0].cells[data.axes.length + 1]];
    // The quantity shown, beside the ratio, which is always there.
    let layer = null;
    function sort() {
      layer = map.layer() ?? data.layers[0];
      const { values } = columns[layer.column];
      const sign = layer.worse === "less" ? 1 : -1;
      // Points without a value come last.
      const order = (cell) => (Number.isFinite(values[cell]) ? sign * values[cell] : Infinity);
      all.sort((a, b) => order(a) - order(b) || a - b);
      const isOther = layer.column !== "ratio_max";
      shownHead.hidden = !isOther;
      shownHead.textContent = withUnit(layer.title, columns[layer.column].unit);
      title.textContent = `Points, the ${layer.worse ? "worst" : "greatest"} first`
        + (isOther ? `: ${layer.title}` : "");
      body.replaceChildren();
      shown = 0;
      extend();
    }
    let shown = 0;
    function extend() {
      for (const cell of all.slice(shown, shown + ROWS_AT_ONCE)) body.append(row(cell));
      shown = Math.min(shown + ROWS_AT_ONCE, all.length);
      more.hidden = shown === all.length;
      more.textContent = `${Math.min(ROWS_AT_ONCE, all.length - shown)} more of `
        + `${all.length - shown}`;
    }
    function row(cell) {
      const show = element("button", { type: "button", onclick: () => map.go(cell) }, "show");
      const largest = word("ratio_max_channel", cell);
      const own = layer.column === "ratio_max" ? [] : [shownValue(layer.column, cell)];
      const texts = [...valuesOf(cell).map((value) => significant(value)), ...own,
        shownValue("ratio_max", cell), largest ? wordsOf(largest) : "",
        verdict(cell).replace("linear model ", "")];
      return element("tr", {}, ...[show, ...texts].map((of) => element("td", {}, of)));
    }
    sort();
    map.onChange(() => map.layer() !== layer && sort());
  }

  function link() {
    const state = { ...map.state(), live: panel?.values() };
    history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(state))}`);
    const tell = (too) => () => { said.textContent = `The link is in the address bar${too}.`; };
    (navigator.clipboard?.writeText(location.href) ?? Promise.reject())
      .then(tell(" and copied"), tell(""));
  }

  function restore() {
    if (location.hash.length < 2) return;
    let state = null;
    try {
      state = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    } catch {
      said.textContent = "The link holds no view of this page.";
    }
    if (!state || typeof state !== "object") return;
    map.restore(state);
    if (Array.isArray(state.live)) panel?.restore(state.live);
  }

  function save(blob, name) {
    const url = URL.createObjectURL(blob);
    element("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
    said.textContent = `Saved as ${name}.`;
  }

  function picture() {
    const [under] = map.canvases;
    const head = Math.round(40 * (under.width / under.clientWidth));
    const whole = element("canvas", { width: under.width, height: under.height + head });
    const context = whole.getContext("2d");
    context.fillStyle = themed("paper");
    context.fillRect(0, 0, whole.width, whole.height);
    write(context, map.title(), head / 3, 0.65 * head,
      { align: "left", size: head / 2, bold: "bold", room: whole.width - head });
    for (const canvas of map.canvases) context.drawImage(canvas, 0, head);
    whole.toBlob((blob) => save(blob, "map.png"));
  }

  function numbers() {
    const place = map.chosen();
    if (!place) {
      said.textContent = "Choose a point of the map first: click it, or press Enter on it.";
      return;
    }
    const cell = map.index(...place);
    const lines = valuesOf(cell).map((value, k) => [data.axes[k].name, value]);
    for (const [name, column] of Object.entries(columns)) {
      const value = column.values[cell];
      lines.push([name, Number.isFinite(value) ? Number(value.toPrecision(7)) : ""]);
    }
    for (const name of Object.keys(data.codes)) lines.push([name, word(name, cell) ?? ""]);
    const text = `name,value\n${lines.map((line) => line.join(",")).join("\n")}\n`;
    save(new Blob([text], { type: "text/csv" }), `point-${shownValue("point", cell, 9)}.csv`);
  }

  restore();
}
