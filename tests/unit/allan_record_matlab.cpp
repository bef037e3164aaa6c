#include <zlib.h>

#include <cstdint>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/support/array_files.hpp"
#include "tests/unit/allan_record_support.hpp"

// Series as variables of MATLAB: version 5 by the library, version 7.3 as HDF5.
namespace allan_record_matlab_test {
namespace {

using namespace ringlock;
using test::AllanRecord;
using test::MatWriter;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class AllanRecordMatlab : public AllanRecord {
   protected:
    std::string path() const { return (directory_ / "log.mat").string(); }
    std::vector<double> values(const std::string& column) { return record::read_series(path(), column).values; }
};

TEST_F(AllanRecordMatlab, VariablesAreColumns) {
    for (const bool packed : {false, true}) {
        {
            MatWriter mat(path());
            mat.add<double>("t", MAT_C_DOUBLE, MAT_T_DOUBLE, 1, 3, {0.0, 0.5, 1.0}, packed);
            mat.add<float>("x", MAT_C_SINGLE, MAT_T_SINGLE, 3, 1, {1.5F, 2.5F, -3.5F}, packed);
            mat.add<double>("m", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, 3, {1, 4, 2, 5, 3, 6}, packed);
            mat.add<std::int32_t>("n", MAT_C_INT32, MAT_T_INT32, 3, 1, {7, 8, -9}, packed);
            mat.add<std::uint8_t>("u", MAT_C_UINT8, MAT_T_UINT8, 3, 1, {250, 251, 252}, packed);
        }
        EXPECT_THAT(record::read_series({path(), "x", "t", 2.0}).values, ElementsAre(1.5, 2.5, -3.5));
        EXPECT_THAT(values("m[1,:]"), ElementsAre(4.0, 5.0, 6.0));
        EXPECT_THAT(values("m[:,2]"), ElementsAre(3.0, 6.0));
        EXPECT_THAT(values("n"), ElementsAre(7.0, 8.0, -9.0));
        EXPECT_THAT(values("u"), ElementsAre(250.0, 251.0, 252.0));
        EXPECT_THAT(error_of(path()), AllOf(HasSubstr("/t"), HasSubstr("/x"), HasSubstr("/m[I,:]")));
    }
}

TEST_F(AllanRecordMatlab, WhatIsNoMatrixOfNumbersIsRefusedByName) {
    {
        MatWriter mat(path());
        mat.add<double>("x", MAT_C_DOUBLE, MAT_T_DOUBLE, 3, 1, {1, 2, 3});
        mat.add_complex("z");
        mat.add_struct("s");
        mat.add_cell("c");
        mat.add<char>("txt", MAT_C_CHAR, MAT_T_UTF8, 1, 3, {'a', 'b', 'c'});
    }
    EXPECT_THAT(error_of(path(), "z"), HasSubstr("complex"));
    EXPECT_THAT(error_of(path(), "s"), HasSubstr("struct"));
    EXPECT_THAT(error_of(path(), "c"), HasSubstr("cell"));
    EXPECT_THAT(error_of(path(), "txt"), HasSubstr("text"));
    EXPECT_THAT(record::read_series(path(), std::nullopt).values, ElementsAre(1.0, 2.0, 3.0));
}

TEST_F(AllanRecordMatlab, AFileThatIsCutOffIsNamed) {
    {
        MatWriter mat(path());
        mat.add<double>("x", MAT_C_DOUBLE, MAT_T_DOUBLE, 200, 1, std::vector<double>(200, 1.0));
    }
    std::ifstream in(path(), std::ios::binary);
    const std::string whole{std::istreambuf_iterator<char>(in), {}};
    for (std::size_t length = 128; length < whole.size(); length += 97) {
        EXPECT_THAT(error_of(file(whole.substr(0, length), "cut.mat")), HasSubstr("cut.mat")) << length;
    }
}

/// A packed variable whose matrix claims `rows` values in `claimed` bytes, with `there` of its numbers.
std::string packed_claim(std::uint32_t rows, std::uint32_t claimed, const std::vector<double>& there) {
    const auto words = [](const std::vector<std::uint32_t>& all) { return test::bytes_of(all); };
    const std::string numbers = test::bytes_of(there);
    const std::string matrix =
        words({14, claimed, 6, 8, 6, 0, 5, 8, rows, 1, (1U << 16U) | 1U, 'x', 9, 8 * rows}) + numbers;
    std::string packed(compressBound(static_cast<uLong>(matrix.size())), '\0');
    uLongf size = static_cast<uLongf>(packed.size());
    compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(matrix.data()),
             static_cast<uLong>(matrix.size()));
    packed.resize(size);
    std::string head = "MATLAB 5.0 MAT-file";
    head.resize(124, ' ');
    return head + std::string("\0\1IM", 4) + words({15, static_cast<std::uint32_t>(size)}) + packed;
}

TEST_F(AllanRecordMatlab, APackedVariableClaimsNoMoreThanItUnpacksTo) {
    const std::vector<double> two = {1.5, 2.5};
    const std::uint32_t heads = 48;  // of the elements within a matrix
    EXPECT_THAT(record::read_series(file(packed_claim(2, heads + 16, two), "good.mat"), "x").values,
                ElementsAre(1.5, 2.5));
    // More values than its numbers have bytes, than what is unpacked has, and than any packing could hold.
    EXPECT_THAT(error_of(file(packed_claim(1000, heads + 16, two), "bad.mat"), "x"), HasSubstr("bad.mat: is cut off"));
    EXPECT_THAT(error_of(file(packed_claim(1000, heads + 8000, two), "bad.mat"), "x"),
                HasSubstr("bad.mat: is cut off"));
    const std::vector<double> zeros(2000);
    EXPECT_THAT(error_of(file(packed_claim(200'000'000, heads + 1'600'000'000, zeros), "bad.mat"), "x"),
                AllOf(HasSubstr("bad.mat: says that a variable of"), HasSubstr("no packing can")));
}

TEST_F(AllanRecordMatlab, AMatrixOfNoBytesClaimsNothing) {
    const std::string head = std::string("MATLAB 5.0 MAT-file") + std::string(105, ' ') + std::string("\0\1IM", 4);
    // The library reads on behind its end.
    const std::string path =
        file(head + test::bytes_of<std::uint32_t>({14, 0, 6, 8, 12, 0, 5, 8, 0xffffffff, 1, 1, 0, 16, 16, 1, 2, 3, 4}),
             "bad.mat");
    EXPECT_THAT(error_of(path), HasSubstr("bad.mat: dataset /: says that it has 4294967295 values"));
}

// The name would mean either.
TEST_F(AllanRecordMatlab, ANameThatOccursTwiceIsRefused) {
    constexpr std::size_t head = 128;
    const auto bytes_with = [&](std::size_t rows) {
        {
            test::MatWriter writer(path());
            writer.add<double>("x", MAT_C_DOUBLE, MAT_T_DOUBLE, rows, 1, std::vector<double>(rows, 1.0));
        }
        std::ifstream in(path(), std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const std::string path = file(bytes_with(3) + bytes_with(4).substr(head), "twice.mat");
    EXPECT_THAT(error_of(path, "x"),
                AllOf(HasSubstr("twice.mat"), HasSubstr("/x"), HasSubstr("occurs more than once in the file; rename")));
}

/// MATLAB 7.3 writes HDF5 behind a block of its own of 512 bytes.
TEST_F(AllanRecordMatlab, Version73IsReadAsHdf5) {
    const hid_t creation = H5Pcreate(H5P_FILE_CREATE);
    H5Pset_userblock(creation, 512);
    const hid_t h5 = H5Fcreate(path().c_str(), H5F_ACC_TRUNC, creation, H5P_DEFAULT);
    const hsize_t sides[2] = {1, 3};
    const hid_t space = H5Screate_simple(2, sides, nullptr);
    const double values_[] = {1.0, 2.0, 3.0};
    const hid_t x = H5Dcreate2(h5, "x", H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(x, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values_);
    const hid_t cell = H5Dcreate2(h5, "c", H5T_STD_REF_OBJ, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t txt = H5Dcreate2(h5, "txt", H5T_STD_U16LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, 4);
    const hid_t scalar = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate2(txt, "MATLAB_class", text, scalar, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, text, "char");
    H5Aclose(attribute);
    H5Sclose(scalar);
    H5Tclose(text);
    for (const hid_t dataset : {x, cell, txt}) H5Dclose(dataset);
    H5Sclose(space);
    H5Fclose(h5);
    H5Pclose(creation);
    EXPECT_THAT(record::read_series(path(), std::nullopt).values, ElementsAre(1.0, 2.0, 3.0));
    EXPECT_THAT(error_of(path(), "c"), HasSubstr("cell"));
    EXPECT_THAT(error_of(path(), "txt"), HasSubstr("text of MATLAB"));
}

}  // namespace
}  // namespace allan_record_matlab_test
