// Time histories and spectra of the live panel.

// The highest frequency of a spectrum, Hz.
const MAX_FREQUENCY_HZ = 25;

// Creates the charts of time histories and spectra of both models.
function createCurves(host, live) {
  const instantCount = 1 + Math.floor((live.endS / live.everyS) * (1 + 1e-12));
  const times = Float32Array.from({ length: instantCount }, (_, k) => k * live.everyS);
  const [firstIndex, lastIndex] = live.windowS.map((timeS) => Math.round(timeS / live.everyS));
  const transformSize = spectrumSize(lastIndex - firstIndex + 1);
  const binWidth = 1 / (transformSize * live.everyS);
  const binCount = Math.min(Math.floor(MAX_FREQUENCY_HZ / binWidth), transformSize / 2);
  const frequencies = Float32Array.from({ length: binCount }, (_, k) => k * binWidth);
  // The version of the motions, by which spectra know whether they are current.
  let version = 0;
  const createLine = (name, colour, count, alpha) => plainLine(name, colour,
    new Float32Array(count).fill(NaN), alpha);
  const createModelLines = (count) => [createLine("nonlinear model", "#0072b2", count),
    createLine("linear model", "#d55e00", count, 0.65)];
  const shownChannel = live.compared[Math.max(live.compared.length - 2, 0)];
  const motionPanels = live.channels.map((channel, k) => plainPanel(channel.name,
    capitalise(channel.words), channel.unit, k === shownChannel, createModelLines(instantCount)));
  const gapPanel = plainPanel("gap", "Gap, drum to tub", "mm", false,
    createModelLines(instantCount));
  const speedPanel = plainPanel("speed", "Spin", "rpm", true,
    [createLine("", "ink", instantCount)], 80);
  // Spectra are computed when they are drawn.
  const createSpectrum = (line, source) => {
    const [y, cache] = [new Float32Array(binCount).fill(NaN), { version: -1 }];
    return Object.defineProperty({ ...line }, "y", { get() {
      if (cache.version === version) return y;
      cache.version = version;
      const values = Array.from(source.y.subarray(firstIndex, lastIndex + 1));
      y.set(spectrum(values, live.everyS, binCount));
      return y;
    } });
  };
  const spectra = live.channels.map((channel, k) => plainPanel(channel.name,
    capitalise(channel.words), channel.unit, k === shownChannel,
    createModelLines(binCount)
      .map((line, model) => createSpectrum(line, motionPanels[k].series[model]))));
  const historyHost = element("div", { id: "live-histories" });
  const spectrumHost = element("div", { id: "live-spectrum" });
  host.append(element("h2", {}, "Time histories"), historyHost,
    element("h2", {}, `Spectrum from ${live.windowS[0]} to ${live.windowS[1]} s`), spectrumHost);
  const charts = [
    createChart(historyHost,
      plainChart("Time", "s", times, [...motionPanels, gapPanel, speedPanel]), "Time histories"),
    createChart(spectrumHost, plainChart("Frequency", "Hz", frequencies, spectra), "Spectrum"),
  ];
  const columnCount = live.channels.length + 1;

  return {
    show(models, speeds) {
      models.forEach((numbers, model) => {
        const count = numbers[0] === 1 ? numbers[3] : 0;
        [...live.channels, { factor: 1e3 }].forEach(({ factor }, k) => {
          const { y } = (motionPanels[k] ?? gapPanel).series[model];
          y.forEach((_, index) => {
            y[index] = index < count ? numbers[4 + index * columnCount + k] * factor : NaN;
          });
        });
      });
      version += 1;
      speedPanel.series[0].y.set(speeds.subarray(0, instantCount));
      charts.forEach((chart) => chart.changed());
    },
  };
}
