#include "engine/ensemble/calibration.hpp"

#include "engine/scenario/injected_noise.hpp"

namespace ringlock::ensemble {

readout::Electronics electronics_of(const scenario::Scenario& scenario) {
    const auto& readout = scenario.readout;
    readout::Electronics electronics{readout.model == scenario::ReadoutModel::ideal,
                                     readout.angle_output == scenario::AngleOutput::interpolated, readout.clock_hz,
                                     readout.detector_noise_relative};
    if (readout.model == scenario::ReadoutModel::instrument) {
        electronics.comparator_noise_relative = readout.comparator_noise_relative;
        electronics.comparator_hysteresis_relative = readout.comparator_hysteresis_relative;
        electronics.detector_bandwidth_hz = readout.detector_bandwidth_hz;
        electronics.adc_bits = static_cast<int>(readout.adc_bits);
    }
    return electronics;
}

double calibrated_b_rad_s(const scenario::Scenario& scenario, const gyro::Device& device) {
    return device.coupling.b_rad_s * (1.0 + scenario.calibration.threshold_error_relative);
}

compensate::Calibration calibration_of(const scenario::Scenario& scenario, std::span<const gyro::Device> devices,
                                       bool noise_injected) {
    compensate::Calibration calibration;
    calibration.lanes = devices.size();
    if (noise_injected) {
        const scenario::InjectedNoise noise = scenario::injected_noise(scenario);
        calibration.amplitude_margin_rad = noise.margin_rad;
        calibration.amplitude_rms_rad = noise.amplitude_rms_rad;
    }
    for (std::size_t lane = 0; lane < devices.size(); ++lane) {
        calibration.b_rad_s[lane] = calibrated_b_rad_s(scenario, devices[lane]);
        calibration.dither_amplitude_rad[lane] = devices[lane].dither_amplitude_rad;
        calibration.positive_duration_s[lane] = devices[lane].positive_duration_s;
        calibration.negative_duration_s[lane] = devices[lane].negative_duration_s;
    }
    return calibration;
}

}  // namespace ringlock::ensemble
