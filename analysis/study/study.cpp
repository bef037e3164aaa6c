#include "analysis/study/study.hpp"

#include <algorithm>
#include <mutex>

#include "engine/ensemble/closed_form.hpp"
#include "engine/ensemble/draw.hpp"

namespace ringlock::study {

Study::Study(const scenario::Scenario& what)
    : scenario(what),
      schedule(what),
      factors(allan::octave_factors(allan::largest_factor(allan::Estimator::oadev, schedule.samples))) {
    const auto total = static_cast<std::size_t>(ensemble::total_gyros(scenario));
    gyros.resize(total);
    for (const std::string& name : scenario.arms) {
        arms.push_back({scenario::parse_arm(name), std::vector<GyroStatistics>(total)});
    }
}

bool has_closed_form(const scenario::Scenario& scenario, const scenario::Arm& arm) {
    const bool plain = !arm.ideal && !arm.noise_injected && arm.compensator == scenario::Compensator::none;
    return plain && ensemble::drive_repeats(scenario);
}

GyroStatistics analyse_record(std::span<const double> angle_arcsec, double interval_s, double input_rate_deg_h,
                              std::span<const std::int64_t> factors) {
    GyroStatistics result;
    const std::vector<double> phase = allan::centred_phase(angle_arcsec, allan::Kind::phase, interval_s);
    result.allan = allan::deviation(allan::Estimator::oadev, phase, interval_s, factors);
    result.noise = noise::fit_noise(angle_arcsec, interval_s);
    const double duration_s = interval_s * static_cast<double>(angle_arcsec.size() - 1);
    result.rate_error_deg_h = (angle_arcsec.back() - angle_arcsec.front()) / duration_s - input_rate_deg_h;
    return result;
}

Study run(const scenario::Scenario& scenario, int threads, const OnRecord& on_record,
          const ensemble::Monitor& monitor) {
    Study study(scenario);
    std::vector<scenario::Arm> arms;
    std::vector<bool> closed_form;
    for (const ArmStatistics& arm : study.arms) {
        arms.push_back(arm.arm);
        closed_form.push_back(has_closed_form(scenario, arm.arm));
    }

    std::mutex mutex;  // sums of whole numbers and a maximum: their order does not matter
    const auto sink = [&](std::int64_t gyro, ensemble::GyroRecord&& record) {
        const auto slot = static_cast<std::size_t>(gyro);
        study.gyros[slot] = record.setup;
        for (std::size_t arm = 0; arm < arms.size(); ++arm) {
            GyroStatistics& found = study.arms[arm].gyros[slot];
            found = analyse_record(record.angle_arcsec[arm], study.schedule.sample_interval_s,
                                   record.setup.input_rate_deg_h, study.factors);
            if (closed_form[arm])
                found.rate_error_closed_form_deg_h = ensemble::closed_form_rate_error_deg_h(record.setup);
        }
        if (on_record) on_record(gyro, record.angle_arcsec);
        const std::lock_guard lock(mutex);
        study.turns += record.turns;
        study.turns_off_table += record.turns_off_table;
        study.turn_map_error_rad = std::max(study.turn_map_error_rad, record.turn_map_error_rad);
    };
    ensemble::run(scenario, arms, 0, ensemble::total_gyros(scenario), threads, sink, monitor);
    return study;
}

}  // namespace ringlock::study
