// Analyses an hour of white rate noise of known strength: the angle random walk that comes out is the one that went in.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <ringlock/allan.hpp>
#include <ringlock/error.hpp>
#include <vector>

int main() {
    try {
        constexpr double rate_hz = 100.0;
        constexpr double arw_deg_rt_h = 0.01;
        // N in deg/sqrt(h) is 60 N in deg/h/sqrt(Hz), whose white samples at rate_hz have this standard deviation.
        std::normal_distribution<double> noise(0.0, 60.0 * arw_deg_rt_h * std::sqrt(rate_hz));
        std::mt19937_64 random(1);
        std::vector<double> rate_deg_h(360000);
        for (double& rate : rate_deg_h) rate = 15.0 + noise(random);

        ringlock::AllanOptions options;
        options.rate_hz = rate_hz;
        options.kind = ringlock::Kind::rate;
        options.unit = "deg/h";
        options.deviations = {"oadev", "mdev"};
        const ringlock::Allan analysis = ringlock::allan(rate_deg_h, options);

        for (const ringlock::AllanPoint& point : analysis.deviation("oadev").points) {
            std::printf("tau %10.2f s  deviation %.5f deg/h (%.5f to %.5f)\n", point.tau_s, point.dev, point.lo,
                        point.hi);
        }
        const ringlock::NoiseCoefficient* arw = analysis.coefficient("arw_deg_rt_h");
        if (arw == nullptr || !arw->value) {
            std::fprintf(stderr, "allan: the record shows no angle random walk\n");
            return EXIT_FAILURE;
        }
        std::printf("%s: %.6f (%.6f to %.6f) %s; made with %.6f\n", arw->name.c_str(), *arw->value, *arw->lo, *arw->hi,
                    arw->unit.c_str(), arw_deg_rt_h);
    } catch (const ringlock::Error& error) {
        std::fprintf(stderr, "allan: %s\n", error.what());
        return EXIT_FAILURE;
    }
}
