// Integrates the trajectories of trajectory.h by Boost odeint's Dormand-Prince 5(4):
// odeint RTOL ATOL
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

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
    std::string program = "Boost odeint " BOOST_LIB_VERSION;
    std::replace(program.begin(), program.end(), '_', '.');

    State x;
    while (washer *machine = next_machine(x.data())) {
        const auto right_hand_side = [&](const State &state, State &slope, double t) {
            washer_rhs(t, state.data(), slope.data(), machine);
        };
        auto stepper = odeint::make_dense_output(atol, rtol, odeint::runge_kutta_dopri5<State>());
        stepper.initialize(x, 0.0, 1e-5);
        for (int next = 0; sample_time(next) < INFINITY;) {
            stepper.do_step(right_hand_side);
            for (; sample_time(next) <= stepper.current_time(); ++next) {
                stepper.calc_state(sample_time(next), x);
                sample(next, x.data());
            }
        }
        report(machine, program.c_str(), "dopri5", rtol, atol);
    }
    return 0;
}
