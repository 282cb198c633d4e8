// Time histories and spectra of the live panel.

// The highest frequency of a spectrum, Hz.
const MAX_FREQUENCY_HZ = 25;

// Creates the charts of time histories and spectra of both models.
function createCurves(host, live) {
  const instants = 1 + Math.floor((live.endS / live.everyS) * (1 + 1e-12));
  const times = Float32Array.from({ length: instants }, (_, k) => k * live.everyS);
  const [from, to] = live.windowS.map((timeS) => Math.round(timeS / live.everyS));
  const size = spectrumSize(to - from + 1);
  const binWidth = 1 / (size * live.everyS);
  const bins = Math.min(Math.floor(MAX_FREQUENCY_HZ / binWidth), size / 2);
  const frequencies = Float32Array.from({ length: bins }, (_, k) => k * binWidth);
  // The version of the motions, by which spectra know whether they are current.
  let version = 0;
  const line = (name, colour, count, alpha) => plainLine(name, colour,
    new Float32Array(count).fill(NaN), alpha);
  const bothModels = (count) => [line("nonlinear model", "#0072b2", count),
    line("linear model", "#d55e00", count, 0.65)];
  const shownChannel = live.compared[Math.max(live.compared.length - 2, 0)];
  const motionPanels = live.channels.map((channel, k) => plainPanel(channel.name,
    capitalise(channel.words), channel.unit, k === shownChannel, bothModels(instants)));
  const gapPanel = plainPanel("gap", "Gap, drum to tub", "mm", false, bothModels(instants));
  const speedPanel = plainPanel("speed", "Spin", "rpm", true, [line("", "ink", instants)], 80);
  // Spectra are computed when they are drawn.
  const spectrumOf = (line, source) => {
    const [y, cache] = [new Float32Array(bins).fill(NaN), { version: -1 }];
    return Object.defineProperty({ ...line }, "y", { get() {
      if (cache.version === version) return y;
      cache.version = version;
      y.set(spectrum(Array.from(source.y.subarray(from, to + 1)), live.everyS, bins));
      return y;
    } });
  };
  const spectra = live.channels.map((channel, k) => plainPanel(channel.name,
    capitalise(channel.words), channel.unit, k === shownChannel,
    bothModels(bins).map((line, model) => spectrumOf(line, motionPanels[k].series[model]))));
  const histories = element("div", { id: "live-histories" });
  const spectrumHost = element("div", { id: "live-spectrum" });
  host.append(element("h2", {}, "Time histories"), histories,
    element("h2", {}, `Spectrum from ${live.windowS[0]} to ${live.windowS[1]} s`), spectrumHost);
  const charts = [
    createChart(histories, plainChart("Time", "s", times, [...motionPanels, gapPanel, speedPanel]),
      "Time histories"),
    createChart(spectrumHost, plainChart("Frequency", "Hz", frequencies, spectra), "Spectrum"),
  ];
  const columns = live.channels.length + 1;

  return {
    show(models, speeds) {
      models.forEach((numbers, model) => {
        const count = numbers[0] === 1 ? numbers[3] : 0;
        [...live.channels, { factor: 1e3 }].forEach(({ factor }, k) => {
          const { y } = (motionPanels[k] ?? gapPanel).series[model];
          y.forEach((_, i) => { y[i] = i < count ? numbers[4 + i * columns + k] * factor : NaN; });
        });
      });
      version += 1;
      speedPanel.series[0].y.set(speeds.subarray(0, instants));
      charts.forEach((chart) => chart.changed());
    },
  };
}
