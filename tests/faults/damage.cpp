#include "tests/faults/damage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>

#include "analysis/record/record.hpp"
#include "tests/support/array_files.hpp"

namespace ringlock::test {

using testing::HasSubstr;
using testing::Not;

std::string DamageTest::with_other_bytes(const std::string& whole, std::mt19937_64& random) {
    std::string bad = whole;
    for (std::uint64_t n = 1 + random() % 3; n > 0; --n) bad[random() % bad.size()] = static_cast<char>(random());
    return bad;
}

std::string DamageTest::with_other_parts(const std::string& whole, std::mt19937_64& random) {
    const std::size_t at = random() % whole.size();
    const std::size_t length = std::min<std::size_t>(8 + random() % 500, whole.size() - at);
    std::string bad = whole;
    switch (random() % 4) {
        case 0:
            return whole.substr(0, at);
        case 1:
            return bad.insert(at, whole.substr(at, length));
        case 2:
            std::fill_n(bad.begin() + static_cast<std::ptrdiff_t>(at), length, '\0');
            return bad;
        default:
            break;
    }
    // A length or a size in a head: eight bytes at a multiple of four, most of them near the front.
    const std::uint64_t values[] = {0, 1, ~std::uint64_t{0}, std::uint64_t{1} << 31, std::uint64_t{1} << 40, 4096};
    const std::uint64_t value = values[random() % std::size(values)];
    const std::size_t place =
        std::min<std::size_t>(random() % (random() % 2 == 0 ? 800 : whole.size()) / 4 * 4, whole.size() - sizeof value);
    std::memcpy(&bad[place], &value, sizeof value);
    return bad;
}

Outcome DamageTest::expect_an_answer(const Attempt& attempt) const {
    const pid_t child = start(attempt.arguments, [&] {
        const rlim_t most_s = attempt.computes ? 120 : 10;
        const rlimit processor{most_s, most_s};
        setrlimit(RLIMIT_CPU, &processor);
        alarm(300);  // a wait without end
    });
    int raw = 0;
    rusage used{};
    wait4(child, &raw, 0, &used);
    Outcome r;
    if (WIFEXITED(raw)) r.status = WEXITSTATUS(raw);
    if (WIFSIGNALED(raw)) r.signal = WTERMSIG(raw);
    r.out = contents(streams_ / "out");
    r.err = contents(streams_ / "err");

    std::string what = attempt.how + ":";
    for (const std::string& word : attempt.arguments) what += " " + word;
    EXPECT_EQ(r.signal, 0) << what;
    EXPECT_THAT(r.status, testing::AnyOf(0, 1, 2)) << what;
    if (r.status != 0) {
        EXPECT_THAT(r.err, HasSubstr(attempt.file)) << what;
        EXPECT_LE(used.ru_utime.tv_sec + used.ru_stime.tv_sec, attempt.processor_s) << what;
    }
    const std::string said = r.out + r.err;
    const auto is_control = [](char c) {
        const auto code = static_cast<unsigned char>(c);
        return (code < 0x20 && c != '\n' && c != '\t') || code == 0x7f;
    };
    EXPECT_FALSE(std::any_of(said.begin(), said.end(), is_control)) << what << "\n" << said;
    EXPECT_THAT(r.out, Not(HasSubstr("-nan"))) << what;
#ifndef __SANITIZE_ADDRESS__
    const double allowed_kb = attempt.memory_mb * 1e3 + static_cast<double>(attempt.bytes) * 1e-3;
    if (r.status != 0 || !attempt.computes) {
        EXPECT_LT(static_cast<double>(used.ru_maxrss), allowed_kb) << what;
    }
#endif
    return r;
}

void DamageTest::write_record(const std::string& name, int samples) const {
    record::Record record;
    record.title = "a short one";
    record.declared.scale_factor_arcsec = 0.6;
    record::Samples& of = record.samples.emplace();
    of.rate_hz = 100.0;
    of.kind = record::SampleKind::angle_increment_arcsec;
    // Sums of uniform numbers: noise of a gyro that nothing is wrong with.
    std::mt19937_64 random(7);
    for (int i = 0; i < samples; ++i) {
        double value = 0.0;
        for (int k = 0; k < 12; ++k) value += std::ldexp(static_cast<double>(random() >> 11U), -53) - 0.5;
        of.values.push_back(0.05 * value);
    }
    record::write_record((directory_ / name).string(), record);
}

void DamageTest::write_table(const std::string& name) const {
    struct Row {
        double t;
        double x;
    };
    std::vector<Row> rows;
    for (int i = 0; i < 200; ++i) rows.push_back({0.01 * i, std::sin(1.0 * i)});
    const hid_t type = H5Tcreate(H5T_COMPOUND, sizeof(Row));
    H5Tinsert(type, "t", HOFFSET(Row, t), H5T_NATIVE_DOUBLE);
    H5Tinsert(type, "x", HOFFSET(Row, x), H5T_NATIVE_DOUBLE);
    const hid_t h5 = H5Fcreate((directory_ / name).c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hsize_t size = rows.size();
    const hsize_t chunk = 50;
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_chunk(creation, 1, &chunk);
    H5Pset_deflate(creation, 1);
    const hid_t space = H5Screate_simple(1, &size, nullptr);
    const hid_t dataset = H5Dcreate2(h5, "imu", type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data());
    H5Dclose(dataset);
    H5Sclose(space);
    H5Pclose(creation);
    H5Tclose(type);
    H5Fclose(h5);
}

void DamageTest::write_array(const std::string& name) const {
    std::vector<double> x;
    for (int i = 0; i < 300; ++i) x.push_back(std::sin(1.0 * i));
    write(name, npy(npy_dictionary("[('t', '<f8'), ('x', '<f8')]", "(150,)"), bytes_of(x)));
}

void DamageTest::write_archive(const std::string& name) const {
    std::vector<double> x;
    std::vector<double> t;
    for (int i = 0; i < 150; ++i) x.push_back(std::sin(1.0 * i));
    for (int i = 0; i < 150; ++i) t.push_back(0.01 * i);
    write_zip((directory_ / name).string(), {{"x.npy", npy(npy_dictionary("'<f8'", "(150,)"), bytes_of(x))},
                                             {"t.npy", npy(npy_dictionary("'<f8'", "(150,)"), bytes_of(t))}});
}

void DamageTest::write_matlab(const std::string& name) const {
    std::vector<double> x;
    for (int i = 0; i < 300; ++i) x.push_back(std::sin(1.0 * i));
    MatWriter((directory_ / name).string()).add<double>("x", MAT_C_DOUBLE, MAT_T_DOUBLE, 300, 1, x, true);
}

}  // namespace ringlock::test
