#include "trajectory.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

/* The number of intervals between samples of the yaw in the window. */
#define INTERVALS 10000

/* The indices of the tub's yaw and of its rate in a state. */
enum { YAW = 4, YAW_RATE = 14 };

static double rest_yaw, start_s;
static double yaws[INTERVALS + 1], rates[INTERVALS + 1];

static double now_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Returns the end of a trajectory: END_S of the environment, or 50 s. */
static double end_s(void) {
    const char *text = getenv("END_S");
    return text ? atof(text) : 50.0;
}

double sample_time(int i) {
    static double end;
    if (end == 0.0) end = end_s();
    return i > INTERVALS ? INFINITY : end * (0.6 + 0.4 * i / INTERVALS);
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
    rest_yaw = x[YAW];
    start_s = now_s();
    return machine;
}

void sample(int i, const double *x) {
    yaws[i] = x[YAW];
    rates[i] = x[YAW_RATE];
}

/* Returns the greatest deviation of the yaw from equilibrium. Between samples the yaw is the cubic
 * through values and rates: at intervals of 2 ms and frequencies below 6 Hz its error is below 1e-7
 * of the amplitude. */
static double max_deviation(void) {
    const double h = sample_time(1) - sample_time(0);
    double max_yaw = 0.0;
    for (int i = 0; i <= INTERVALS; ++i) {
        max_yaw = fmax(max_yaw, fabs(yaws[i] - rest_yaw));
        if (i == INTERVALS || rates[i] * rates[i + 1] > 0.0) continue;
        const double difference = yaws[i + 1] - yaws[i];
        const double start_slope = h * rates[i], end_slope = h * rates[i + 1];
        /* The slope of the cubic is start_slope + 2 a s + 3 b s^2, with s from 0 to 1. */
        const double b = start_slope + end_slope - 2.0 * difference;
        const double a = difference - start_slope - b;
        double s = start_slope / (start_slope - end_slope);
        for (int k = 0; k < 4; ++k) {
            const double curvature = 2.0 * a + 6.0 * b * s;
            if (curvature != 0.0) s -= (start_slope + s * (2.0 * a + 3.0 * b * s)) / curvature;
        }
        if (s > 0.0 && s < 1.0)
            max_yaw = fmax(max_yaw, fabs(yaws[i] + s * (start_slope + s * (a + s * b)) - rest_yaw));
    }
    return max_yaw;
}

void report(washer *machine, const char *program, const char *method, double rtol, double atol) {
    const double seconds = now_s() - start_s;
    printf("{\"program\": \"%s\", \"method\": \"%s\", \"settings\": \"rtol %.0e, atol %.0e\", "
           "\"tub_yaw\": %.17g, \"seconds\": %.6f}\n",
           program, method, rtol, atol, max_deviation(), seconds);
    fflush(stdout);
    washer_free(machine);
}
