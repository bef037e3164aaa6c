#include "analysis/parts/block_record.hpp"

#include "analysis/parts/archive.hpp"

namespace ringlock {

// Found by the types of the values, so in their namespaces. A structure that gets a member has another size: then the
// member belongs into the list here, too.

namespace gyro {

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Ellipse>
void each(Archive& archive, T& e) {
    static_assert(sizeof(Ellipse) == 4 * sizeof(double));
    archive(e.gain);
    archive(e.offset_sin);
    archive(e.offset_cos);
    archive(e.orthogonality_rad);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Setup>
void each(Archive& archive, T& s) {
    static_assert(sizeof(Setup) == 14 * sizeof(double) + sizeof(Ellipse));
    archive(s.scale_factor_arcsec);
    archive(s.lockin_threshold_deg_h);
    archive(s.coupling_phase_rad);
    archive(s.dither_frequency_hz);
    archive(s.dither_peak_rate_deg_s);
    archive(s.dither_asymmetry_ratio);
    archive(s.dither_harmonic_ratio);
    archive(s.dither_harmonic_phase_rad);
    archive(s.lockin_turn_asymmetry);
    archive(s.lockin_second_ratio);
    archive(s.lockin_second_phase_rad);
    archive(s.input_rate_deg_h);
    archive(s.initial_phase_rad);
    archive(s.ellipse);
    archive(s.missed_count_probability);
}

}  // namespace gyro

namespace allan {

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Point>
void each(Archive& archive, T& p) {
    static_assert(sizeof(Point) == 9 * sizeof(double));
    archive(p.m);
    archive(p.tau_s);
    archive(p.dev);
    archive(p.terms);
    archive(p.alpha);
    archive(p.bias);
    archive(p.edf);
    archive(p.lo);
    archive(p.hi);
}

}  // namespace allan

namespace noise {

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Coefficient>
void each(Archive& archive, T& c) {
    archive(c.resolved);
    archive(c.value);
    archive(c.lo);
    archive(c.hi);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Estimate>
void each(Archive& archive, T& e) {
    archive(e.value);
    archive(e.lo);
    archive(e.hi);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Sinusoid>
void each(Archive& archive, T& s) {
    static_assert(sizeof(Sinusoid) == 2 * sizeof(Estimate) + sizeof(double));
    archive(s.frequency_hz);
    archive(s.rate_amplitude_deg_h);
    archive(s.evidence);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Correlated>
void each(Archive& archive, T& c) {
    static_assert(sizeof(Correlated) == 3 * sizeof(Estimate) + sizeof(double));
    archive(c.correlation_time_s);
    archive(c.amplitude_deg_h_rt_h);
    archive(c.rms_rate_deg_h);
    archive(c.evidence);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Pooling>
void each(Archive& archive, T& p) {
    static_assert(sizeof(Pooling) == 6 * sizeof(double));
    archive(p.arw_evidence);
    archive(p.angle_noise_evidence);
    archive(p.arw_alone_deg_rt_h);
    archive(p.arw_beside_angle_noise_deg_rt_h);
    archive(p.arw_best_deg_rt_h);
    archive(p.red);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, Goodness>
void each(Archive& archive, T& g) {
    static_assert(sizeof(Goodness) == 5 * sizeof(double) + sizeof(std::string));
    archive(g.p_cumulative);
    archive(g.p_bands);
    archive(g.p_line);
    archive(g.p_around_lines);
    archive(g.accepted);
    archive(g.reason);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, NoiseFit>
void each(Archive& archive, T& f) {
    static_assert(sizeof(NoiseFit) == 5 * sizeof(Coefficient) + sizeof(std::vector<Sinusoid>) +
                                          sizeof(std::optional<Correlated>) + sizeof(Pooling) + sizeof(double) +
                                          sizeof(std::string) + sizeof(Goodness) + sizeof(std::size_t));
    archive(f.quantization_arcsec);
    archive(f.arw_deg_rt_h);
    archive(f.bias_instability_deg_h);
    archive(f.rrw_deg_h_rt_h);
    archive(f.rate_ramp_deg_h_h);
    archive(f.sinusoids);
    archive(f.correlated);
    archive(f.pooling);
    archive(f.described);
    archive(f.reason);
    archive(f.goodness);
    archive(f.samples);
}

}  // namespace noise

namespace study {

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, GyroStatistics>
void each(Archive& archive, T& g) {
    static_assert(sizeof(GyroStatistics) == sizeof(std::vector<allan::Point>) + sizeof(noise::NoiseFit) +
                                                sizeof(double) + sizeof(std::optional<double>) + sizeof(double) +
                                                sizeof(std::vector<double>));
    archive(g.allan);
    archive(g.noise);
    archive(g.rate_error_deg_h);
    archive(g.rate_error_closed_form_deg_h);
    archive(g.change_per_cycle_rad);
    archive(g.angle_error_arcsec);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, FinishedBlock>
void each(Archive& archive, T& b) {
    static_assert(sizeof(FinishedBlock) == 6 * sizeof(double) + 2 * sizeof(std::vector<gyro::Setup>));
    archive(b.study);
    archive(b.first_gyro);
    archive(b.gyros);
    archive(b.arms);
    archive(b.turns);
    archive(b.tables_remade);
    archive(b.contradictory_readings);
    archive(b.turn_map_error_rad);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, SampledAngles>
void each(Archive& archive, T& s) {
    static_assert(sizeof(SampledAngles) == 5 * sizeof(double) + sizeof(std::vector<double>));
    archive(s.study);
    archive(s.first_gyro);
    archive(s.arm);
    archive(s.gyros);
    archive(s.first_sample);
    archive(s.angle_arcsec);
}

}  // namespace study

namespace parts {

namespace {

template <class T>
std::vector<std::byte> packed(const T& value) {
    Packer archive;
    archive(value);
    return archive.take();
}

template <class T>
T unpacked(std::span<const std::byte> bytes) {
    Unpacker archive(bytes);
    T value;
    archive(value);
    if (!archive.at_end()) throw InputError("a record of gyros goes on after its end");
    return value;
}

}  // namespace

std::vector<std::byte> pack(const study::FinishedBlock& block) { return packed(block); }
std::vector<std::byte> pack(const study::SampledAngles& samples) { return packed(samples); }
study::FinishedBlock unpack_block(std::span<const std::byte> bytes) { return unpacked<study::FinishedBlock>(bytes); }
study::SampledAngles unpack_samples(std::span<const std::byte> bytes) { return unpacked<study::SampledAngles>(bytes); }

BlockName block_of(std::span<const std::byte> bytes) {
    Unpacker archive(bytes);
    BlockName name;
    archive(name.study);
    archive(name.first_gyro);
    return name;
}

}  // namespace parts

}  // namespace ringlock
