#include <array>

#include "tests/unit/allan_record_support.hpp"

// Fields of records, enumerations, and what else is no plain dataset of HDF5.
namespace allan_record_compound_test {
namespace {

using namespace ringlock;
using test::AllanRecordHdf5;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

struct Axes {
    double x;
    float y;
};
struct Row {
    double t;
    Axes gyro;
    std::int32_t count;
    double pair[2];
    std::int8_t ok;
};

class AllanRecordCompound : public AllanRecordHdf5 {
   protected:
    void write_table(const char* name) {
        const hid_t axes = H5Tcreate(H5T_COMPOUND, sizeof(Axes));
        H5Tinsert(axes, "x", HOFFSET(Axes, x), H5T_NATIVE_DOUBLE);
        H5Tinsert(axes, "y", HOFFSET(Axes, y), H5T_NATIVE_FLOAT);
        const hsize_t two = 2;
        const hid_t pair = H5Tarray_create2(H5T_NATIVE_DOUBLE, 1, &two);
        const hid_t truth = H5Tenum_create(H5T_NATIVE_INT8);
        const std::int8_t no = 0, yes = 1;
        H5Tenum_insert(truth, "FALSE", &no);
        H5Tenum_insert(truth, "TRUE", &yes);
        const hid_t row = H5Tcreate(H5T_COMPOUND, sizeof(Row));
        H5Tinsert(row, "t", HOFFSET(Row, t), H5T_NATIVE_DOUBLE);
        H5Tinsert(row, "gyro", HOFFSET(Row, gyro), axes);
        H5Tinsert(row, "count", HOFFSET(Row, count), H5T_NATIVE_INT32);
        H5Tinsert(row, "pair", HOFFSET(Row, pair), pair);
        H5Tinsert(row, "ok", HOFFSET(Row, ok), truth);
        std::vector<Row> rows;
        for (int i = 0; i < 4; ++i) {
            rows.push_back({0.5 * i,
                            {1.0 + i, static_cast<float>(10 * i)},
                            100 * i,
                            {-1.0 * i, 7.0 * i},
                            static_cast<std::int8_t>(i % 2)});
        }
        write(name, row, row, rows);
        for (const hid_t type : {axes, pair, truth, row}) H5Tclose(type);
    }
};

TEST_F(AllanRecordCompound, FieldsAreColumnsByPathOrName) {
    write_table("imu");
    close();
    const auto values = [&](const std::string& column) { return record::read_series(path(), column).values; };
    EXPECT_THAT(values("/imu/gyro/x"), ElementsAre(1.0, 2.0, 3.0, 4.0));
    EXPECT_THAT(values("gyro/y"), ElementsAre(0.0, 10.0, 20.0, 30.0));
    EXPECT_THAT(values("count"), ElementsAre(0.0, 100.0, 200.0, 300.0));
    EXPECT_THAT(values("ok"), ElementsAre(0.0, 1.0, 0.0, 1.0));
    EXPECT_THAT(values("imu/pair[:,1]"), ElementsAre(0.0, 7.0, 14.0, 21.0));
    EXPECT_THAT(record::read_series({path(), "x", "t", 2.0}).values, ElementsAre(1.0, 2.0, 3.0, 4.0));
    EXPECT_THAT(error_of(path()), AllOf(HasSubstr("/imu/t"), HasSubstr("/imu/gyro/x"), HasSubstr("/imu/pair[:,J]")));
    EXPECT_THAT(error_of(path(), "pair"), HasSubstr("[:,J]"));
    EXPECT_THAT(error_of(path(), "pair[0,:]"), HasSubstr("only columns"));
}

TEST_F(AllanRecordCompound, ANameOfTwoFieldsMustBeSaid) {
    write_table("left");
    write_table("right");
    EXPECT_THAT(refusal("count"), AllOf(HasSubstr("/left/count"), HasSubstr("/right/count")));
}

TEST_F(AllanRecordCompound, BitFieldsAndTextAreRefusedByName) {
    write("bits", H5T_STD_B8LE, H5T_NATIVE_B8, std::vector<std::uint8_t>{1, 2, 3});
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, 2);
    write("words", text, text, std::vector<std::array<char, 2>>{{'a', 'b'}, {'c', 'd'}});
    H5Tclose(text);
    close();
    EXPECT_THAT(error_of(path(), "bits"), HasSubstr("bit fields"));
    EXPECT_THAT(error_of(path(), "words"), HasSubstr("text"));
    EXPECT_THAT(error_of(path()), AllOf(HasSubstr("no dataset of numbers"), HasSubstr("/bits"), HasSubstr("/words")));
}

TEST_F(AllanRecordCompound, TheUnitOfADatasetIsTold) {
    write("x", {1.0, 2.0});
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, 6);
    const hid_t scalar = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate_by_name(h5_, "x", "units", text, scalar, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, text, "deg/h ");
    H5Aclose(attribute);
    H5Sclose(scalar);
    H5Tclose(text);
    EXPECT_EQ(read().unit, "deg/h");
}

TEST_F(AllanRecordCompound, AValueWithoutASquareIsNamed) {
    write("x", {1.0, 2.0, 1e200, 4.0});
    EXPECT_THAT(refusal(), AllOf(HasSubstr("/x"), HasSubstr("value 3"), HasSubstr("1e+200")));
    EXPECT_THAT(error_of(file("x\n1\n-1e160\n", "a.txt")),
                AllOf(HasSubstr("column x"), HasSubstr("value 2"), HasSubstr("-1e+160")));
}

}  // namespace
}  // namespace allan_record_compound_test
