// Boost odeint's Dormand-Prince 5(4) on the trajectory: odeint RTOL ATOL
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <boost/numeric/odeint.hpp>
#include <boost/version.hpp>

#include "trajectory.h"

int main(int argc, char **argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: odeint RTOL ATOL\n");
        return 2;
    }
    namespace odeint = boost::numeric::odeint;
    using State = std::array<double, DIMENSION>;
    const double rtol = std::atof(argv[1]), atol = std::atof(argv[2]);

    washer *machine = paper_trajectory();
    State x;
    washer_initial_state(machine, x.data());
    const double rest = x[YAW];
    long evaluations = 0, steps = 0;
    const auto right_hand_side = [&](const State &state, State &slope, double t) {
        ++evaluations;
        washer_rhs(t, state.data(), slope.data(), machine);
    };
    std::vector<double> yaw(SAMPLES + 1), rate(SAMPLES + 1);

    const double begin = seconds_now();
    auto stepper = odeint::make_dense_output(atol, rtol, odeint::runge_kutta_dopri5<State>());
    stepper.initialize(x, 0.0, 1e-5);
    int next = 0;
    while (next <= SAMPLES) {
        stepper.do_step(right_hand_side);
        ++steps;
        for (; next <= SAMPLES && sample_time(next) <= stepper.current_time(); ++next) {
            stepper.calc_state(sample_time(next), x);
            yaw[next] = x[YAW];
            rate[next] = x[YAW_RATE];
        }
    }
    const double most = greatest(yaw.data(), rate.data(), rest);
    const double seconds = seconds_now() - begin;

    std::string version = BOOST_LIB_VERSION;
    std::replace(version.begin(), version.end(), '_', '.');
    report(("Boost odeint " + version).c_str(), "dopri5", rtol, atol, most, seconds, evaluations,
           steps);
    washer_free(machine);
    return 0;
}
