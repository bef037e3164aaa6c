#include <sys/stat.h>

#include <filesystem>
#include <utility>

#include "tests/unit/allan_record_support.hpp"

// How a file leads to others, and what it claims and cannot hold.
namespace allan_record_links_test {
namespace {

using namespace ringlock;
using test::AllanRecordHdf5;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class AllanRecordLinks : public AllanRecordHdf5 {
   protected:
    /// Another file, with one dataset.
    std::string other() {
        const std::string path = (directory_ / "other.h5").string();
        const hid_t ours = std::exchange(h5_, H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
        write("secret", {7.0, 8.0, 9.0});
        H5Fclose(std::exchange(h5_, ours));
        return path;
    }

    std::string error(const std::string& column, bool follow = false) {
        return error_of({.path = path(), .column = column, .time = {}, .follow_links = follow});
    }
    std::vector<double> values(const std::string& column, bool follow = false) {
        return record::read_series({.path = path(), .column = column, .time = {}, .follow_links = follow}).values;
    }
};

TEST_F(AllanRecordLinks, SoftLinksAreFollowed) {
    const hid_t group = H5Gcreate2(h5_, "g", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Gclose(group);
    write("g/x", {1.0, 2.0});
    H5Lcreate_soft("/g/x", h5_, "alias", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/g", h5_, "folder", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/g/loop", h5_, "g/loop", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_hard(h5_, "g", h5_, "g/back", H5P_DEFAULT, H5P_DEFAULT);
    close();
    EXPECT_THAT(values("alias"), ElementsAre(1.0, 2.0));
    EXPECT_THAT(values("folder/x"), ElementsAre(1.0, 2.0));
    EXPECT_THAT(record::read_series(path(), std::nullopt).values, ElementsAre(1.0, 2.0)) << "an alias is no second one";
    EXPECT_THAT(error("loop"), HasSubstr("'loop'"));
}

TEST_F(AllanRecordLinks, ExternalLinksAreFollowedOnRequestAlone) {
    const std::string file = other();
    write("x", {1.0, 2.0});
    H5Lcreate_external("other.h5", "/secret", h5_, "out", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/out", h5_, "soft", H5P_DEFAULT, H5P_DEFAULT);
    close();
    for (const char* name : {"out", "soft"}) {
        EXPECT_THAT(error(name), AllOf(HasSubstr("other.h5"), HasSubstr("/secret"), HasSubstr("--follow-links")));
        EXPECT_THAT(values(name, true), ElementsAre(7.0, 8.0, 9.0));
    }
}

TEST_F(AllanRecordLinks, AFifoIsNotWaitedFor) {
    ASSERT_EQ(mkfifo((directory_ / "fifo").c_str(), 0600), 0);
    write("x", {1.0, 2.0});
    H5Lcreate_external("fifo", "/secret", h5_, "out", H5P_DEFAULT, H5P_DEFAULT);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(creation, "fifo", 0, 16);
    const hsize_t two = 2;
    const hid_t space = H5Screate_simple(1, &two, nullptr);
    H5Dclose(H5Dcreate2(h5_, "raw", H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
    H5Sclose(space);
    H5Pclose(creation);
    close();
    for (const bool follow : {false, true}) {
        EXPECT_THAT(error("out", follow), HasSubstr("fifo"));
        EXPECT_THAT(error("raw", follow), HasSubstr("fifo"));
    }
    EXPECT_THAT(values("x"), ElementsAre(1.0, 2.0));
}

TEST_F(AllanRecordLinks, RawDataOutsideAreReadOnRequestAlone) {
    const std::vector<double> secret = {7.0, 8.0, 9.0};
    std::ofstream(directory_ / "secret.bin", std::ios::binary)
        .write(reinterpret_cast<const char*>(secret.data()), static_cast<std::streamsize>(3 * sizeof(double)));
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(creation, (directory_ / "secret.bin").c_str(), 0, 24);
    const hsize_t three = 3;
    const hid_t space = H5Screate_simple(1, &three, nullptr);
    H5Dclose(H5Dcreate2(h5_, "raw", H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
    H5Sclose(space);
    H5Pclose(creation);
    close();
    EXPECT_THAT(error("raw"), AllOf(HasSubstr("secret.bin"), HasSubstr("--follow-links")));
    EXPECT_THAT(values("raw", true), ElementsAre(7.0, 8.0, 9.0));
}

TEST_F(AllanRecordLinks, VirtualDatasetsOverOtherFilesAreReadOnRequestAlone) {
    const std::string file = other();
    write("x", {1.0, 2.0, 3.0});
    const hsize_t three = 3;
    const hid_t space = H5Screate_simple(1, &three, nullptr);
    const auto add = [&](const char* name, const char* of_file, const char* dataset) {
        const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
        H5Pset_virtual(creation, space, of_file, dataset, space);
        H5Dclose(H5Dcreate2(h5_, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
        H5Pclose(creation);
    };
    add("outside", file.c_str(), "/secret");
    add("inside", ".", "/x");
    add("itself", ".", "/itself");
    H5Sclose(space);
    close();
    EXPECT_THAT(error("outside"), AllOf(HasSubstr("other.h5"), HasSubstr("--follow-links")));
    EXPECT_THAT(values("outside", true), ElementsAre(7.0, 8.0, 9.0));
    EXPECT_THAT(values("inside"), ElementsAre(1.0, 2.0, 3.0));
    EXPECT_THAT(error("itself"), HasSubstr("damaged"));
}

TEST_F(AllanRecordLinks, ADatasetLargerThanItsFileIsRefusedAtOnce) {
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk = 1000;
    H5Pset_chunk(creation, 1, &chunk);
    H5Pset_deflate(creation, 9);
    const hsize_t huge = hsize_t{1} << 40;
    const hid_t space = H5Screate_simple(1, &huge, nullptr);
    const hid_t dataset = H5Dcreate2(h5_, "x", H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    const double one = 1.0;
    const hsize_t first = 0;
    const hsize_t count = 1;
    const hid_t memory = H5Screate_simple(1, &count, nullptr);
    H5Sselect_elements(space, H5S_SELECT_SET, 1, &first);
    H5Dwrite(dataset, H5T_NATIVE_DOUBLE, memory, space, H5P_DEFAULT, &one);
    H5Sclose(memory);
    H5Dclose(dataset);
    H5Sclose(space);
    H5Pclose(creation);
    EXPECT_THAT(refusal("x"), AllOf(HasSubstr("/x"), HasSubstr("cannot hold")));
}

TEST_F(AllanRecordLinks, WhatPacksWellIsRead) {
    write("x", std::vector<double>(2'000'000, 0.25), {.sides = {}, .chunk = 100'000});
    close();
    EXPECT_LT(std::filesystem::file_size(path()), 100'000U);
    EXPECT_EQ(record::read_series(path(), "x").values, std::vector<double>(2'000'000, 0.25));
}

TEST_F(AllanRecordLinks, NamesAreShownWrittenOut) {
    write("a\x1b[2J\nb", {1.0});
    write("c\xff", {1.0});
    const std::string error = refusal();
    EXPECT_THAT(error, AllOf(HasSubstr("/a\\x1b[2J\\x0ab"), HasSubstr("/c\\xff"), Not(HasSubstr("\x1b"))));
}

}  // namespace
}  // namespace allan_record_links_test
