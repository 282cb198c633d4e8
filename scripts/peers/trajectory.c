#include "trajectory.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

/* The window's yaw is sampled at these many intervals. */
#define SAMPLES 10000

enum { YAW = 4, YAW_RATE = 14 };

static double rest, begin_s;
static double yaw[SAMPLES + 1], rate[SAMPLES + 1];

static double now_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* 50 s unless the environment has other END_S: a check of the programs takes less. */
static double end_s(void) {
    const char *given = getenv("END_S");
    return given ? atof(given) : 50.0;
}

double sample_time(int i) {
    static double end;
    if (end == 0.0) end = end_s();
    return i > SAMPLES ? INFINITY : end * (0.6 + 0.4 * i / SAMPLES);
}

washer *next_machine(double *x) {
    static const char *const names[] = {"unbalance_mass_kg", "damping_n_s_per_m"};
    double values[2];
    char model[16];
    if (scanf("%15s %lf %lf", model, &values[0], &values[1]) != 3) return NULL;
    const washer_setup setup = {model, "triangular", 350.0, 50.0, NULL, NULL, 0, names, values, 2};
    washer *machine = NULL;
    enum washer_status status = washer_new(&setup, &machine);
    if (status != WASHER_OK || washer_dimension() != DIMENSION) {
        fprintf(stderr, "no machine: status %d\n", (int)status);
        exit(1);
    }
    washer_initial_state(machine, x);
    rest = x[YAW];
    begin_s = now_s();
    return machine;
}

void sample(int i, const double *x) {
    yaw[i] = x[YAW];
    rate[i] = x[YAW_RATE];
}

/* Greatest deviation of the yaw from rest, between samples by the cubic through values and rates:
 * at 2 ms and less than 6 Hz its error is below 1e-7 of the amplitude. */
static double greatest(void) {
    const double h = sample_time(1) - sample_time(0);
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

void report(washer *machine, const char *program, const char *method, double rtol, double atol) {
    const double seconds = now_s() - begin_s;
    printf("{\"program\": \"%s\", \"method\": \"%s\", \"settings\": \"rtol %.0e, atol %.0e\", "
           "\"tub_yaw\": %.17g, \"seconds\": %.6f}\n",
           program, method, rtol, atol, greatest(), seconds);
    fflush(stdout);
    washer_free(machine);
}
