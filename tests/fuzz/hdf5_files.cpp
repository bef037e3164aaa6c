#include "tests/fuzz/hdf5_files.hpp"

#include <fmt/format.h>
#include <hdf5.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>

#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::fuzz {
namespace {

constexpr hsize_t rows = 24;

/// The bytes of a file that is written in a process of its own, so that none of the threads that may write it are left.
std::string bytes_of_file(const std::function<void(const std::string& path)>& write) {
    const std::string path =
        (std::filesystem::temp_directory_path() / fmt::format("ringlock-fuzz-made-{}.h5", ::getpid())).string();
    const pid_t writer = fork();
    if (writer == 0) {
        write(path);
        _exit(0);
    }
    int status = 0;
    waitpid(writer, &status, 0);
    std::ifstream in(path, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(in), {}};
    std::filesystem::remove(path);
    if (status != 0 || bytes.empty()) throw RunError("an input of the search cannot be made");
    return bytes;
}

std::vector<double> wave() {
    std::vector<double> values;
    for (hsize_t i = 0; i < rows; ++i) values.push_back(std::sin(static_cast<double>(i)));
    return values;
}

enum class Layout { plain, packed, compact };

void add_dataset(hid_t at, const char* name, hid_t type, const std::vector<hsize_t>& sides, const void* values,
                 Layout layout) {
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    if (layout == Layout::packed) {
        std::vector<hsize_t> chunk = sides;
        chunk[0] = 10;
        H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data());
        H5Pset_shuffle(creation);
        H5Pset_deflate(creation, 1);
        H5Pset_fletcher32(creation);
    } else if (layout == Layout::compact) {
        H5Pset_layout(creation, H5D_COMPACT);
    }
    std::vector<hsize_t> largest = sides;
    if (layout == Layout::packed) largest[0] = H5S_UNLIMITED;
    const hid_t space = H5Screate_simple(static_cast<int>(sides.size()), sides.data(), largest.data());
    const hid_t set = H5Dcreate2(at, name, type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values);
    H5Dclose(set);
    H5Sclose(space);
    H5Pclose(creation);
}

void add_text(hid_t to, const char* name, const char* text, bool of_any_length) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, of_any_length ? H5T_VARIABLE : 16);
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate2(to, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    if (of_any_length) {
        H5Awrite(attribute, type, &text);
    } else {
        std::string fixed(text);
        fixed.resize(16, '\0');
        H5Awrite(attribute, type, fixed.data());
    }
    H5Aclose(attribute);
    H5Sclose(space);
    H5Tclose(type);
}

struct Row {
    double t;
    double x;
    float pair[2];
    signed char mode;
};

void add_table(hid_t at, Layout layout) {
    std::vector<Row> table;
    for (hsize_t i = 0; i < rows; ++i) table.push_back({0.01 * static_cast<double>(i), 1.0, {1.0F, 2.0F}, 1});
    const hid_t mode = H5Tcreate(H5T_ENUM, sizeof(signed char));
    const signed char off = 0;
    const signed char on = 1;
    H5Tenum_insert(mode, "off", &off);
    H5Tenum_insert(mode, "on", &on);
    const hsize_t two = 2;
    const hid_t pair = H5Tarray_create2(H5T_NATIVE_FLOAT, 1, &two);
    const hid_t type = H5Tcreate(H5T_COMPOUND, sizeof(Row));
    H5Tinsert(type, "t", HOFFSET(Row, t), H5T_NATIVE_DOUBLE);
    H5Tinsert(type, "x", HOFFSET(Row, x), H5T_NATIVE_DOUBLE);
    H5Tinsert(type, "pair", HOFFSET(Row, pair), pair);
    H5Tinsert(type, "mode", HOFFSET(Row, mode), mode);
    add_dataset(at, "imu", type, {rows}, table.data(), layout);
    H5Tclose(type);
    H5Tclose(pair);
    H5Tclose(mode);
}

/// A log as recorders write it; `newest` is the layout of the library's later versions, whose heads have checksums.
void write_log(const std::string& path, Layout layout, bool newest) {
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    if (newest) H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
    const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
    const hid_t group = H5Gcreate2(file, "run", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    std::vector<double> t;
    std::vector<std::int32_t> counts;
    for (hsize_t i = 0; i < rows; ++i) {
        t.push_back(0.01 * static_cast<double>(i));
        counts.push_back(static_cast<std::int32_t>(i * i));
    }
    add_dataset(group, "t", H5T_NATIVE_DOUBLE, {rows}, t.data(), layout);
    add_dataset(group, "x", H5T_NATIVE_DOUBLE, {rows}, wave().data(), layout);
    add_dataset(group, "counts", H5T_NATIVE_INT32, {rows / 2, 2}, counts.data(), layout);
    add_table(file, layout);
    add_text(group, "unit", "deg/h", true);
    add_text(group, "title", "a log", false);
    const double rate_hz = 100.0;
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate2(group, "rate_hz", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, H5T_NATIVE_DOUBLE, &rate_hz);
    H5Aclose(attribute);
    H5Sclose(space);
    H5Lcreate_soft("/run/x", file, "gyro", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_hard(file, "/run", group, "loop", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_external("elsewhere.h5", "/x", file, "away", H5P_DEFAULT, H5P_DEFAULT);
    H5Gclose(group);
    H5Fclose(file);
    H5Pclose(access);
}

record::Record record_of_samples(record::SampleKind kind) {
    record::Record record;
    record.title = "a short one";
    record.declared.scale_factor_arcsec = 0.6;
    record::Samples& samples = record.samples.emplace();
    samples.rate_hz = 100.0;
    samples.kind = kind;
    for (hsize_t i = 0; i < rows; ++i) {
        if (kind == record::SampleKind::quarter_count) samples.counts.push_back(static_cast<std::int64_t>(i));
    }
    if (kind != record::SampleKind::quarter_count) samples.values = wave();
    samples.witnesses["accel_x"] = wave();
    record.temperature_c = {{0.0, 0.1, 0.2}, {20.0, 21.0, 20.5}};
    return record;
}

record::Record record_of_turns() {
    record::Record record;
    record.title = "a few turns";
    record.declared.scale_factor_arcsec = 0.6;
    record.declared.dither_frequency_hz = 400.0;
    record::Turns& turns = record.turns.emplace();
    for (hsize_t i = 0; i < rows; ++i) {
        const auto n = static_cast<double>(i);
        turns.time_s.push_back(n / 800.0);
        turns.direction.push_back(i % 2 == 0 ? 1 : -1);
        turns.quarter_count.push_back(static_cast<std::int64_t>(i % 2 == 0 ? i : 4000 + i));
        turns.sine.push_back(std::sin(n));
        turns.cosine.push_back(std::cos(n));
        turns.accel_before_rad_s2.push_back(1e7);
        turns.accel_after_rad_s2.push_back(1e7);
    }
    return record;
}

}  // namespace

std::vector<Hdf5File> hdf5_files() {
    std::vector<Hdf5File> all;
    const std::vector<std::string> columns = {
        "x", "t", "run/x", "counts[:,0]", "counts[1,:]", "imu/x", "imu/t", "imu/mode", "imu/pair[:,1]", "gyro", "away"};
    for (const Layout layout : {Layout::plain, Layout::packed, Layout::compact}) {
        for (const bool newest : {false, true}) {
            all.push_back({bytes_of_file([&](const auto& path) { write_log(path, layout, newest); }), false, columns});
        }
    }
    for (const auto kind : {record::SampleKind::angle_increment_arcsec, record::SampleKind::quarter_count}) {
        all.push_back({bytes_of_file([&](const auto& path) { record::write_record(path, record_of_samples(kind)); })});
    }
    all.push_back({bytes_of_file([](const auto& path) { record::write_record(path, record_of_turns()); })});
    for (const bool with_angles : {false, true}) {
        scenario::Scenario one = test::small(with_angles);
        one.ensemble.duration_s = 20.0;
        all.push_back({bytes_of_file([&](const auto& path) { test::write(path, one); }), true});
    }
    all.push_back({bytes_of_file([](const auto& path) { test::write(path, test::small_design(false)); }), true});
    return all;
}

}  // namespace ringlock::fuzz
