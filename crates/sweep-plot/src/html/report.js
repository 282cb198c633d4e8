// What makes a map's page a report: the run in words, what to be careful about, all points in a
// table, the worst in what is shown first, and what can be taken away.

// Rows of the table at a time.
const ROWS_AT_ONCE = 20;

function createReport(host, data, map, panel) {
  const { columns, counts, filled, failed, word, verdict, shownValue } = map.cells;
  const all = Array.from({ length: columns.point.values.length }, (_, cell) => cell)
    .filter(filled);

  const said = element("p", { class: "help", role: "status" });
  const button = (text, id, onclick) => element("button", { type: "button", id, onclick }, text);
  const take = element("div", { class: "controls", id: "take" },
    button("Link to this view", "link", link), button("Picture (PNG)", "picture", picture),
    button("Numbers of this point (CSV)", "numbers", numbers));
  const table = createTable();
  host.append(take, said, element("section", { id: "about" },
    ...createAbout(data),
    element("h2", {}, "What to be careful about"),
    element("ul", {}, ...caveats().map((text) => element("li", {}, text))),
    ...table));

  function caveats() {
    const what = counts ? "cells" : "points";
    const share = (count, are) => `${count} of ${all.length} ${what} ${are}`;
    const found = [];
    const chaotic = all.filter((cell) => (counts ? counts.sensitive[cell] > 0
      : word("sensitive", cell) === "true")).length;
    if (chaotic) {
      found.push(`${share(chaotic, "are sensitive")}: the motion is chaotic, and its digits are `
        + "those of one trajectory.");
    }
    const lost = all.filter(failed).length;
    if (lost) found.push(`${share(lost, "failed")}; the map hatches them.`);
    if (counts) {
      found.push("A cell holds several points and shows the worst of them. The file has all.");
    }
    found.push("A map shows one course of speeds. Whether the machine may stay at a speed is "
      + "another question; the command sweep stability answers it.");
    found.push("Numbers that nobody gave are assumed. The command sweep parameters says of each "
      + "where it is from.");
    return found;
  }

  function createTable() {
    const heads = ["", ...data.axes.map((axis) => withUnit(axis.words, axis.unit)),
      "Largest ratio", "in", "Verdict"];
    const body = element("tbody");
    const [title, shownHead] = [element("h2"), element("th", { scope: "col" })];
    // What is shown, beside the ratio that stands there anyway.
    let layer = null;
    function sort() {
      layer = map.layer() ?? data.layers[0];
      const { values } = columns[layer.column];
      const sign = layer.worse === "less" ? 1 : -1;
      // What has no value last.
      const order = (cell) => (Number.isFinite(values[cell]) ? sign * values[cell] : Infinity);
      const order0 = new Map(all.map((cell) => [cell, order(cell)]));
      all.sort((a, b) => order0.get(a) - order0.get(b) || a - b);
      const isOther = layer.column !== "ratio_max";
      shownHead.hidden = !isOther;
      shownHead.textContent = withUnit(layer.title, columns[layer.column].unit);
      title.textContent = `Points, the ${layer.worse ? "worst" : "greatest"} first`
        + (isOther ? `: ${layer.title}` : "");
      body.replaceChildren();
      shown = 0;
      extend();
    }
    const more = button(`${ROWS_AT_ONCE} more`, "more", () => extend());
    let shown = 0;
    function extend() {
      for (const cell of all.slice(shown, shown + ROWS_AT_ONCE)) body.append(row(cell));
      shown = Math.min(shown + ROWS_AT_ONCE, all.length);
      more.hidden = shown === all.length;
      more.textContent = `${Math.min(ROWS_AT_ONCE, all.length - shown)} more of `
        + `${all.length - shown}`;
    }
    function row(cell) {
      const values = valuesOf(cell).map((value) => element("td", {}, significant(value)));
      const largest = word("ratio_max_channel", cell);
      const of = data.rows.find((one) => one.name === largest)?.words ?? "";
      const own = layer.column === "ratio_max" ? []
        : [element("td", {}, shownValue(layer.column, cell))];
      return element("tr", {},
        element("td", {}, button("show", null, () => map.go(cell))), ...values, ...own,
        element("td", {}, shownValue("ratio_max", cell)), element("td", {}, of),
        element("td", {}, verdict(cell).replace("linear model ", "")));
    }
    const headCells = heads.map((text) => element("th", { scope: "col" }, text));
    headCells.splice(data.axes.length + 1, 0, shownHead);
    sort();
    map.onChange(() => map.layer() !== layer && sort());
    return [title, element("div", { class: "wide-table" },
      element("table", { id: "points" },
        element("thead", {}, element("tr", {}, ...headCells)), body), more)];
  }

  // Values of the axes at a cell.
  function valuesOf(cell) {
    let left = cell;
    return data.axes.reduceRight((found, axis) => {
      found.unshift(axis.values[left % axis.values.length]);
      left = Math.floor(left / axis.values.length);
      return found;
    }, []);
  }

  function link() {
    const state = { ...map.state(), live: panel?.values() };
    history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(state))}`);
    const done = () => { said.textContent = "The link is in the address bar and copied."; };
    const refused = () => { said.textContent = "The link is in the address bar."; };
    if (navigator.clipboard) navigator.clipboard.writeText(location.href).then(done, refused);
    else refused();
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
    context.fillStyle = themed("ink");
    context.font = `bold ${head / 2}px ${FONT}`;
    context.fillText(map.title(), head / 3, 0.65 * head, whole.width - head);
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
