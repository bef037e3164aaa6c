#include "tests/support/drive.hpp"

#include <boost/random/normal_distribution.hpp>

namespace ringlock::test {

Drive::Drive(const gyro::Device& device, double turn_phase_rms_rad, random::Identity who)
    : device_(device), rms_rad_(turn_phase_rms_rad), who_(who) {
    noise_rad_ = noise_at(0);
    next_noise_rad_ = noise_at(1);
    before_ = device_.half_cycle(-1.0, device_.dither_amplitude_rad - 0.5 * noise_rad_);
    after_ = make_after();
}

double Drive::noise_at(std::int64_t turn) {
    if (rms_rad_ == 0.0) return 0.0;
    // Normal deviates use a varying number of words: a counter of its own keeps every turn where it is.
    random::Engine engine = random::make_engine(who_, random::Purpose::noise_injection);
    engine.setcounter({{0, static_cast<std::uint64_t>(turn), 0, who_.gyro}}, 0);
    return rms_rad_ * boost::random::normal_distribution<double>()(engine);
}

double Drive::time_s() const {
    return static_cast<double>(turn_ / 2) * device_.period_s() + (turn_ % 2 == 0 ? 0.0 : device_.positive_duration_s);
}

gyro::HalfCycle Drive::make_after() const {
    const double sign = direction();
    return device_.half_cycle(sign, device_.dither_amplitude_rad + 0.5 * sign * (next_noise_rad_ - noise_rad_));
}

void Drive::advance() {
    ++turn_;
    noise_rad_ = next_noise_rad_;
    next_noise_rad_ = noise_at(turn_ + 1);
    before_ = after_;
    after_ = make_after();
}

double Drive::amplitude_margin_rad(double turn_phase_rms_rad) {
    // Half the difference of two deviates has an rms of rms/sqrt(2); 8 of these.
    return 8.0 * turn_phase_rms_rad / std::sqrt(2.0);
}

}  // namespace ringlock::test
