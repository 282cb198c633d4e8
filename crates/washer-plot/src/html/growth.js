// The panel's point at constant speeds: the growth of small disturbances, and the amplitudes of the
// attractors.

// The least speed (rpm); the number of speeds, about, and of those in a call: for a machine whose
// growth takes long to compute, and for others.
const SPEED_RULE = { from: 50, slow: [24, 1], quick: [300, 10] };

// Returns the numbers of the fastest-growing disturbance at each speed: growth (1/s), frequency
// (cycles per minute), kind, and whether the response is on the curve of a machine that runs up.
async function computeGrowth(pool, kind, values, speeds) {
  const urgency = kind === "check" ? 1 : 0;
  const { numbers } = await pool.request(kind, urgency, "growth", [...values, ...speeds],
    [values.length]);
  return Array.from(speeds, (_, k) => numbers.slice(1 + 4 * k, 5 + 4 * k));
}

// Returns the note on speeds at which the response is off the curve of a machine that runs up.
function offCurveNote(speeds, isOnCurve) {
  const offCurve = Array.from(speeds).filter((_, k) => isOnCurve[k] === 0);
  const speedList = offCurve.map((rpm) => formatSignificant(rpm)).join(", ");
  return speedList && ` Off the curve of responses at ${speedList} rpm: a machine that runs up may `
    + "be in another motion there.";
}

// The computation of each metric at the map's constant speeds. It returns a sentence and its
// numbers.
const HELD_METRICS = {
  async growth(pool, values, { heldSpeedsRpm: speeds }) {
    const disturbances = await computeGrowth(pool, "check", values, speeds);
    const growth = disturbances.map(([growthPerS]) => growthPerS);
    const greatest = Math.max(...growth.filter(Number.isFinite));
    return [Number.isFinite(greatest) ? `Growth at most ${formatSignificant(greatest, 3)} /s, at `
      + `${formatSignificant(speeds[growth.indexOf(greatest)])} rpm of ${speeds.length} constant `
      + "speeds."
      + offCurveNote(speeds, disturbances.map((disturbance) => disturbance[3]))
      : "No response at any of the map's constant speeds.", [greatest]];
  },
  async dwell(pool, values, { heldSpeedsRpm: speeds, channels, motions }) {
    const point = [...values, ...speeds];
    const { numbers } = await pool.request("check", 1, "dwell", point, [values.length]);
    const [, speed, motion, ...deviations] = numbers;
    const deviationTexts = channels.map(({ words, unit, factor }, k) => `${words} `
      + `${formatSignificant(deviations[k] * factor, 3)} ${unit}`);
    return [Number.isNaN(speed) ? "No motion was found at any of the map's constant speeds."
      : `Held at ${speeds.length} constant speeds, it goes as far as ${deviationTexts.join(", ")}; `
        + `the tub turns farthest at ${formatSignificant(speed)} rpm (${motions[motion]}).`,
    deviations];
  },
};

function createGrowth(host, live, pool) {
  const find = appendTemplate(host, "growth");
  const [box, status, chartHost] = ["#live-growth", "#growth-status", "#live-growth-chart"]
    .map(find);
  box.addEventListener("toggle", compute);
  const [count, batchSize] = live.hasSlowGrowth ? SPEED_RULE.slow : SPEED_RULE.quick;
  let point = null;
  let isDone = true;
  let requestCount = 0;

  // Returns the speeds in whole steps up to the greatest speed of the spin.
  function speedsUpTo(peak) {
    const from = Math.min(SPEED_RULE.from, peak / 4);
    const step = Math.max(1, Math.round((peak - from) / count));
    const length = Math.max(2, 1 + Math.floor((peak - from) / step + 1e-6));
    return Float32Array.from({ length }, (_, k) => from + step * k);
  }

  async function compute() {
    if (!box.open || !point || isDone) return;
    isDone = true;
    requestCount += 1;
    const requestId = requestCount;
    const speeds = speedsUpTo(point.peak);
    const startMs = performance.now();
    const [y, frequencies] = [0, 1].map(() => new Float32Array(speeds.length).fill(NaN));
    const line = (values) => [{ ...plainLine("", "#0072b2", values), width: 1.6 }];
    const panels = [plainPanel("growth", "Growth", "1/s", true, line(y), 200),
      plainPanel("frequency", "Frequency", "cycles/min", true, line(frequencies), 110)];
    panels[0].levels = [[0, "neither growth nor decay"]];
    const spec = plainChart("Spin speed", "rpm", speeds, panels);
    spec.shadeMeaning = "disturbances grow";
    chartHost.replaceChildren();
    const chart = createChart(chartHost, spec, "Growth of disturbances over speed");
    const [kinds, isOnCurve] = [[], []];
    let remaining = speeds.length;
    const computeBatch = async (k) => {
      const batch = speeds.subarray(k, k + batchSize);
      const disturbances = await computeGrowth(pool, "growth", point.values, batch);
      if (requestId !== requestCount) return;
      disturbances.forEach((disturbance, i) => {
        [y[k + i], frequencies[k + i], kinds[k + i], isOnCurve[k + i]] = disturbance;
      });
      remaining -= batch.length;
      status.textContent = `Computing: ${remaining} of ${speeds.length} speeds are left.`;
      chart.changed();
    };
    try {
      const batchCount = Math.ceil(remaining / batchSize);
      const starts = Array.from({ length: batchCount }, (_, k) => k * batchSize);
      await Promise.all(starts.map(computeBatch));
    } catch (error) {
      if (error && requestId === requestCount) {
        status.textContent = `It could not be computed: ${error.message}.`;
      }
      return;
    }
    if (requestId !== requestCount) return;
    // The ranges of speeds at which disturbances grow.
    const runs = [];
    speeds.forEach((_, k) => {
      if (!(y[k] > 0)) return;
      if (runs.at(-1)?.at(-1) === k - 1) runs.at(-1).push(k);
      else runs.push([k]);
    });
    spec.shades = runs.map((run) => [speeds[run[0]], speeds[run.at(-1)]]);
    chart.changed();
    const rangeTexts = runs.map((run) => {
      const peakIndex = run.reduce((a, b) => (y[b] > y[a] ? b : a));
      const [first, last] = [run[0], run.at(-1)].map((k) => formatSignificant(speeds[k]));
      return `from ${first} to ${last} rpm (`
        + `${live.kinds[kinds[peakIndex]]}, at most ${formatSignificant(y[peakIndex], 3)}/s at `
        + `${formatSignificant(speeds[peakIndex])} rpm)`;
    });
    const summary = rangeTexts.length ? `Disturbances grow ${rangeTexts.join(", and ")}.`
      : "Disturbances decay at every speed.";
    const seconds = ((performance.now() - startMs) / 1000).toFixed(1);
    const note = offCurveNote(speeds, isOnCurve);
    status.textContent = `${summary}${note} ${speeds.length} speeds in ${seconds} s.`;
    box.dataset.speeds = speeds.join(" ");
    box.dataset.growth = y.join(" ");
    box.dataset.point = point.values.join(" ");
  }

  return {
    // Discards the point, which has changed.
    discardPoint() {
      requestCount += 1;
      pool.cancel("growth");
      point = null;
      if (box.open) status.textContent = "The point moves.";
    },
    // Sets the point after its change, with the greatest speed of its spin.
    setPoint(values, peak) {
      point = { values, peak };
      isDone = false;
      compute();
    },
  };
}
