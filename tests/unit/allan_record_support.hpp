#pragma once
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "engine/core/error.hpp"
#include "tests/support/temporary_directory.hpp"

/// Files of series for the tests of their readers.
namespace ringlock::test {

/// The message of the InputError that `action` throws.
template <class Action>
std::string message_or(Action action, const std::string& otherwise) {
    try {
        action();
    } catch (const InputError& error) {
        return error.what();
    }
    return otherwise;
}

/// NaN equals NaN.
MATCHER_P(is_the_number, expected, "") { return arg == expected || (std::isnan(arg) && std::isnan(expected)); }

inline auto same_numbers(const std::vector<double>& expected) {
    std::vector<testing::Matcher<double>> each;
    for (const double value : expected) each.push_back(is_the_number(value));
    return testing::ElementsAreArray(each);
}

struct Streamed {
    record::SeriesInfo info;
    std::vector<double> values;
    std::size_t longest = 0;  ///< piece
};

inline Streamed stream(const record::SeriesRequest& request) {
    Streamed out;
    out.info = record::stream_series(request, [&](std::span<const double> piece) {
        out.values.insert(out.values.end(), piece.begin(), piece.end());
        out.longest = std::max(out.longest, piece.size());
    });
    return out;
}

class AllanRecord : public testing::Test {
   protected:
    std::string file(const std::string& text, const std::string& name = "data.txt") const {
        std::ofstream(directory_ / name, std::ios::binary) << text;
        return (directory_ / name).string();
    }
    static std::string error_of(const record::SeriesRequest& request) {
        return message_or([&] { record::read_series(request); }, "no error");
    }
    static std::string error_of(const std::string& path, const std::optional<std::string>& column = std::nullopt) {
        return message_or([&] { record::read_series(path, column); }, "no error");
    }

    test::TemporaryDirectory directory_;
};

/// How a dataset lies in its file.
struct Storage {
    std::vector<hsize_t> sides = {};  ///< of one dimension where empty
    hsize_t chunk = 0;                ///< packed in chunks of that many rows; 0: contiguous
};

/// One HDF5 file.
class AllanRecordHdf5 : public AllanRecord {
   protected:
    void SetUp() override {
        H5dont_atexit();  // as the reader does, which comes too late here
        h5_ = H5Fcreate(path().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    }
    void TearDown() override { close(); }
    void close() {
        if (h5_ >= 0) H5Fclose(h5_);
        h5_ = -1;
    }
    std::string path() const { return (directory_ / "data.h5").string(); }

    std::string contents() const {
        std::ifstream in(path(), std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

    template <class T>
    void write(const char* name, hid_t stored, hid_t in_memory, const std::vector<T>& values,
               const Storage& storage = {}) {
        std::vector<hsize_t> sides = storage.sides;
        if (sides.empty()) sides = {values.size()};
        const hid_t space = H5Screate_simple(static_cast<int>(sides.size()), sides.data(), nullptr);
        const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
        if (storage.chunk > 0) {
            std::vector<hsize_t> chunk = sides;
            chunk[0] = storage.chunk;
            H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data());
            H5Pset_deflate(creation, 1);
        }
        const hid_t dataset = H5Dcreate2(h5_, name, stored, space, H5P_DEFAULT, creation, H5P_DEFAULT);
        if (!values.empty()) H5Dwrite(dataset, in_memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
        H5Dclose(dataset);
        H5Pclose(creation);
        H5Sclose(space);
    }
    void write(const char* name, const std::vector<double>& values, const Storage& storage = {}) {
        write(name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values, storage);
    }
    /// Closes the file and reads from it.
    record::Series read(const std::optional<std::string>& column = std::nullopt,
                        const std::optional<std::string>& time = std::nullopt, double rate_hz = 0.0) {
        close();
        return record::read_series(record::SeriesRequest{path(), column, time, rate_hz});
    }
    std::string refusal(const std::optional<std::string>& column = std::nullopt,
                        const std::optional<std::string>& time = std::nullopt, double rate_hz = 0.0) {
        close();
        return error_of(record::SeriesRequest{path(), column, time, rate_hz});
    }

    hid_t h5_ = -1;
};

}  // namespace ringlock::test
