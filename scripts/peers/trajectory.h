/* The work unit of the comparison and how its result is taken: the same for every program. */
#ifndef TRAJECTORY_H
#define TRAJECTORY_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "washer.h"

#define DIMENSION 20
/* 50 s unless the environment has other END_S: a check of the programs takes less. */
#define END_S end_s()
/* The window's yaw is sampled at these many intervals, by each program's own dense output. */
#define WINDOW_FROM_S (0.6 * END_S)
#define SAMPLES 20000

static inline double end_s(void) {
    const char *given = getenv("END_S");
    return given ? atof(given) : 50.0;
}

enum { YAW = 4, YAW_RATE = 14 };

static inline washer *paper_trajectory(void) {
    static const char *const names[] = {"unbalance_mass_kg", "damping_n_s_per_m"};
    static const double values[] = {0.4, 140.0};
    const char *linear = getenv("LINEAR");
    const char *model = linear && *linear ? "linear" : "nonlinear";
    const washer_setup setup = {model, "triangular", 350.0, 50.0, NULL, NULL, 0, names, values, 2};
    washer *made = NULL;
    enum washer_status status = washer_new(&setup, &made);
    if (status != WASHER_OK || washer_dimension() != DIMENSION) {
        fprintf(stderr, "no machine: status %d\n", (int)status);
        exit(1);
    }
    return made;
}

static inline double sample_time(int i) {
    return WINDOW_FROM_S + i * (END_S - WINDOW_FROM_S) / SAMPLES;
}

/* Greatest deviation of the yaw from `rest`, between samples by the cubic through values and
 * rates: at 1 ms and less than 6 Hz its error is below 1e-8 of the amplitude. */
static inline double greatest(const double *yaw, const double *rate, double rest) {
    const double h = (END_S - WINDOW_FROM_S) / SAMPLES;
    double most = 0.0;
    for (int i = 0; i <= SAMPLES; ++i) {
        most = fmax(most, fabs(yaw[i] - rest));
        if (i == SAMPLES || rate[i] * rate[i + 1] > 0.0) continue;
        const double difference = yaw[i + 1] - yaw[i];
        const double start = h * rate[i], end = h * rate[i + 1];
        /* Slope of the cubic over s: start + 2 a s + 3 b s^2. */
        const double b = start + end - 2.0 * difference, a = difference - start - b;
        double s = start / (start - end);
        for (int k = 0; k < 4; ++k) {
            const double curvature = 2.0 * a + 6.0 * b * s;
            if (curvature != 0.0) s -= (start + s * (2.0 * a + 3.0 * b * s)) / curvature;
        }
        if (s > 0.0 && s < 1.0)
            most = fmax(most, fabs(yaw[i] + s * (start + s * (a + s * b)) - rest));
    }
    return most;
}

static inline double seconds_now(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* One line of JSON per run. */
static inline void report(const char *program, const char *method, double rtol, double atol,
                          double yaw, double seconds, long evaluations, long steps) {
    printf("{\"program\": \"%s\", \"method\": \"%s\", \"settings\": \"rtol %.0e, atol %.0e\", "
           "\"yaw_rad\": %.17g, \"seconds\": %.6f, \"evaluations\": %ld, \"steps\": %ld}\n",
           program, method, rtol, atol, yaw, seconds, evaluations, steps);
    fflush(stdout);
}

#endif
