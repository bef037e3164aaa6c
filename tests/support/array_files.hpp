#pragma once
#include <archive.h>
#include <archive_entry.h>
#include <fmt/format.h>
#include <matio.h>

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

/// Files of arrays as other programs write them, for tests.
namespace ringlock::test {

/// The bytes of numbers, in the byte order asked for.
template <class T>
std::string bytes_of(const std::vector<T>& values, bool big_endian = false) {
    std::string out;
    for (const T value : values) {
        std::string bytes(sizeof value, '\0');
        std::memcpy(bytes.data(), &value, sizeof value);
        if (big_endian) bytes = std::string(bytes.rbegin(), bytes.rend());
        out += bytes;
    }
    return out;
}

/// A .npy file: its dictionary, padded as NumPy pads it, and its data.
inline std::string npy(const std::string& dictionary, const std::string& data, char version = 1) {
    std::string head = dictionary;
    const std::size_t preamble = version == 1 ? 10 : 12;
    while ((preamble + head.size() + 1) % 64 != 0) head += ' ';
    head += '\n';
    std::string out = std::string("\x93NUMPY") + version + '\0';
    for (std::size_t i = 0; i < preamble - 8; ++i) out += static_cast<char>((head.size() >> (8 * i)) & 0xff);
    return out + head + data;
}
inline std::string npy_dictionary(const std::string& type, const std::string& shape, bool fortran = false) {
    return fmt::format("{{'descr': {}, 'fortran_order': {}, 'shape': {}, }}", type, fortran ? "True" : "False", shape);
}

/// A zip archive with these files.
inline void write_zip(const std::string& path, const std::vector<std::pair<std::string, std::string>>& files,
                      bool packed = true) {
    archive* zip = archive_write_new();
    archive_write_set_format_zip(zip);
    archive_write_set_options(zip, packed ? "zip:compression=deflate" : "zip:compression=store");
    archive_write_open_filename(zip, path.c_str());
    for (const auto& [name, content] : files) {
        archive_entry* entry = archive_entry_new();
        archive_entry_set_pathname(entry, name.c_str());
        archive_entry_set_size(entry, static_cast<la_int64_t>(content.size()));
        archive_entry_set_filetype(entry, AE_IFREG);
        archive_entry_set_perm(entry, 0644);
        archive_write_header(zip, entry);
        archive_write_data(zip, content.data(), content.size());
        archive_entry_free(entry);
    }
    archive_write_close(zip);
    archive_write_free(zip);
}

/// A MAT-file of version 5 that is being written.
class MatWriter {
   public:
    explicit MatWriter(const std::string& path) : file_(Mat_CreateVer(path.c_str(), nullptr, MAT_FT_MAT5)) {}
    MatWriter(const MatWriter&) = delete;
    MatWriter& operator=(const MatWriter&) = delete;
    ~MatWriter() { Mat_Close(file_); }

    /// Values of a matrix column by column.
    template <class T>
    void add(const std::string& name, matio_classes of, matio_types type, std::size_t rows, std::size_t columns,
             std::vector<T> values, bool packed = false) {
        std::size_t sides[2] = {rows, columns};
        matvar_t* variable = Mat_VarCreate(name.c_str(), of, type, 2, sides, values.data(), MAT_F_DONT_COPY_DATA);
        Mat_VarWrite(file_, variable, packed ? MAT_COMPRESSION_ZLIB : MAT_COMPRESSION_NONE);
        Mat_VarFree(variable);
    }
    void add_complex(const std::string& name) {
        std::size_t sides[2] = {2, 1};
        double real[2] = {1.0, 2.0};
        double imaginary[2] = {3.0, 4.0};
        mat_complex_split_t both{real, imaginary};
        matvar_t* variable = Mat_VarCreate(name.c_str(), MAT_C_DOUBLE, MAT_T_DOUBLE, 2, sides, &both, MAT_F_COMPLEX);
        Mat_VarWrite(file_, variable, MAT_COMPRESSION_NONE);
        Mat_VarFree(variable);
    }
    void add_struct(const std::string& name) {
        std::size_t sides[2] = {1, 1};
        const char* fields[] = {"x"};
        matvar_t* variable = Mat_VarCreateStruct(name.c_str(), 2, sides, fields, 1);
        Mat_VarWrite(file_, variable, MAT_COMPRESSION_NONE);
        Mat_VarFree(variable);
    }
    void add_cell(const std::string& name) {
        std::size_t sides[2] = {1, 1};
        std::size_t one[2] = {1, 1};
        double value = 1.0;
        matvar_t* cell = Mat_VarCreate(name.c_str(), MAT_C_CELL, MAT_T_CELL, 2, sides, nullptr, 0);
        Mat_VarSetCell(cell, 0, Mat_VarCreate(nullptr, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, one, &value, 0));
        Mat_VarWrite(file_, cell, MAT_COMPRESSION_NONE);
        Mat_VarFree(cell);
    }

   private:
    mat_t* file_;
};

}  // namespace ringlock::test
