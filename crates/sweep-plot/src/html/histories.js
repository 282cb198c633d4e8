// Time histories of one point, as the page of a map carries them, and the channel that is shown at
// first.
function createHistories(host, trace, channel) {
  const names = Object.keys(trace.series);
  const values = (name) => {
    const { data: text, unit, factor } = trace.series[name];
    return quantised(text, unit * factor);
  };
  const series = (name, title, colour, alpha) => plainLine(title, colour, values(name), alpha);
  const panel = (name, words, unit, lines) => plainPanel(name, words, unit, true, lines);
  const both = (name, [nonlinear, linear], words) => {
    const lines = [[nonlinear, "nonlinear model", "#0072b2"],
      [linear, "linear model", "#d55e00", 0.65]].filter(([column]) => names.includes(column));
    const { shown } = trace.series[nonlinear];
    return panel(name, words, shown, lines.map((line) => series(...line)));
  };
  const panels = names.filter((name) => name.startsWith("nonlinear_")).map((column) => {
    const name = column.slice("nonlinear_".length);
    const words = capitalised(trace.series[column].words);
    const one = both(name, [column, `linear_${name}`], words);
    one.shown = name === channel;
    return one;
  });
  if (panels.length && !panels.some((one) => one.shown)) panels[0].shown = true;
  if (names.includes("gap_nonlinear_m")) {
    const gaps = both("gap", ["gap_nonlinear_m", "gap_linear_m"], "Gap, drum to tub");
    const found = gaps.series.flatMap((one) => [...one.y]).filter(Number.isFinite);
    const [least, widest] = extremes(found);
    if (least < 0.5 * widest) gaps.levels = [[0, "gap closed"]];
    panels.push(gaps);
  }
  if (names.includes("speed_rpm")) {
    panels.push(panel("speed", "Spin", "rpm", [series("speed_rpm", "", "ink")]));
  }
  createChart(host, plainChart("Time", "s", floats(trace.time_s), panels), "Time histories");
}
