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
  const offCurveSpeeds = Array.from(speeds).filter((_, k) => isOnCurve[k] === 0);
  const speedList = offCurveSpeeds.map((rpm) => formatSignificant(rpm)).join(", ");
  return speedList && ` Off the curve of responses at ${speedList} rpm: a machine that runs up may `
    + "be in another motion there.";
}

// The computation of each metric at the map's constant speeds. It returns a sentence and its
// numbers.
const HELD_METRICS = {
  async growth(pool, values, { heldSpeedsRpm: speeds }) {
    const disturbances = await computeGrowth(pool, "check", values, speeds);
    const growths = disturbances.map(([growthPerS]) => growthPerS);
    const maxGrowth = Math.max(...growths.filter(Number.isFinite));
    return [Number.isFinite(maxGrowth) ? `Growth at most ${formatSignificant(maxGrowth, 3)} /s, at `
      + `${formatSignificant(speeds[growths.indexOf(maxGrowth)])} rpm of ${speeds.length} constant `
      + "speeds."
      + offCurveNote(speeds, disturbances.map((disturbance) => disturbance[3]))
      : "No response at any of the map's constant speeds.", [maxGrowth]];
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
  box.addEventListener("toggle", computePoint);
  const [speedCount, batchSize] = live.hasSlowGrowth ? SPEED_RULE.slow : SPEED_RULE.quick;
  let point = null;
  let isDone = true;
  let requestCount = 0;

  // Returns the speeds in whole steps up to the greatest speed of the spin.
  function speedsUpTo(peak) {
    const minSpeed = Math.min(SPEED_RULE.from, peak / 4);
    const speedStep = Math.max(1, Math.round((peak - minSpeed) / speedCount));
    const length = Math.max(2, 1 + Math.floor((peak - minSpeed) / speedStep + 1e-6));
    return Float32Array.from({ length }, (_, k) => minSpeed + speedStep * k);
  }

  async function computePoint() {
    if (!box.open || !point || isDone) return;
    isDone = true;
    requestCount += 1;
    const requestId = requestCount;
    const speeds = speedsUpTo(point.peak);
    const startMs = performance.now();
    const [growths, frequencies] = [0, 1].map(() => new Float32Array(speeds.length).fill(NaN));
    const createLines = (values) => [{ ...plainLine("", "#0072b2", values), width: 1.6 }];
    const panels = [plainPanel("growth", "Growth", "1/s", true, createLines(growths), 200),
      plainPanel("frequency", "Frequency", "cycles/min", true, createLines(frequencies), 110)];
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
        [growths[k + i], frequencies[k + i], kinds[k + i], isOnCurve[k + i]] = disturbance;
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
    const growingRuns = [];
    speeds.forEach((_, k) => {
      if (!(growths[k] > 0)) return;
      if (growingRuns.at(-1)?.at(-1) === k - 1) growingRuns.at(-1).push(k);
      else growingRuns.push([k]);
    });
    spec.shades = growingRuns.map((run) => [speeds[run[0]], speeds[run.at(-1)]]);
    chart.changed();
    const rangeTexts = growingRuns.map((run) => {
      const peakIndex = run.reduce((a, b) => (growths[b] > growths[a] ? b : a));
      const [first, last] = [run[0], run.at(-1)].map((k) => formatSignificant(speeds[k]));
      return `from ${first} to ${last} rpm (`
        + `${live.kinds[kinds[peakIndex]]}, at most `
        + `${formatSignificant(growths[peakIndex], 3)}/s at `
        + `${formatSignificant(speeds[peakIndex])} rpm)`;
    });
    const summary = rangeTexts.length ? `Disturbances grow ${rangeTexts.join(", and ")}.`
      : "Disturbances decay at every speed.";
    const seconds = ((performance.now() - startMs) / 1000).toFixed(1);
    const note = offCurveNote(speeds, isOnCurve);
    status.textContent = `${summary}${note} ${speeds.length} speeds in ${seconds} s.`;
    box.dataset.speeds = speeds.join(" ");
    box.dataset.growth = growths.join(" ");
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
      computePoint();
    },
  };
}
