#include "analysis/text/source/identify.hpp"

#include <cstddef>
#include <span>

namespace ringlock::text {
namespace {

using namespace std::string_view_literals;

struct Magic {
    std::size_t at;
    std::string_view bytes;
    Identity identity;
};

constexpr std::string_view unpack_it = "unpack it and name the file within"sv;
constexpr std::string_view export_it = "export its numbers as text (CSV) or HDF5"sv;

// More specific ones come before those that they contain. Sources: the specifications of the formats and file(1).
constexpr Magic magics[] = {
    {0, "\x1f\x8b"sv, {"packed with gzip", unpack_it}},
    {0, "\xfd\x37zXZ\0"sv, {"packed with xz", unpack_it}},
    {0, "\x28\xb5\x2f\xfd"sv, {"packed with Zstandard", unpack_it}},
    {0, "BZh"sv, {"packed with bzip2", "unpack it with bunzip2, or pack it with gzip, xz or zstd, which are read"}},
    {0, "\x1f\x9d"sv, {"packed with compress", unpack_it}},
    {0, "\x04\x22\x4d\x18"sv, {"packed with lz4", unpack_it}},
    {0, "7z\xbc\xaf\x27\x1c"sv, {"a 7z archive", unpack_it}},
    {0, "Rar!\x1a\x07"sv, {"a RAR archive", unpack_it}},
    {257, "ustar"sv, {"a tar archive", unpack_it}},
    {0, "\x93NUMPY"sv, {"a NumPy array (.npy)", "save it with numpy.savetxt, or as HDF5"}},
    {0, "\x89HDF\r\n\x1a\n"sv, {"HDF5, which cannot be read from a stream", "name the file"}},
    {0, "MATLAB 5.0 MAT-file"sv, {"a MATLAB file of version 5", "save it with save(..., '-v7.3'), which is HDF5"}},
    {0, "#ROSBAG V"sv, {"a ROS bag", "export the topic as CSV"}},
    {0, "\x89MCAP0\r\n"sv, {"an MCAP log (ROS 2)", "export the topic as CSV"}},
    {0, "SQLite format 3\0"sv, {"a SQLite database (a ROS 2 bag is one)", "export the table or topic as CSV"}},
    {0, "PAR1"sv, {"a Parquet table", export_it}},
    {0, "ARROW1"sv, {"an Arrow table (Feather)", export_it}},
    {0, "FEA1"sv, {"a Feather table", export_it}},
    {0, "MDF     "sv, {"a measurement of ASAM MDF (.mf4, .mdf)", export_it}},
    {0, "UnFinMF "sv, {"an unfinished measurement of ASAM MDF (.mf4)", export_it}},
    {0, "TDSm"sv, {"a LabVIEW measurement (TDMS)", export_it}},
    {0, "ULog\x01\x12\x35"sv, {"a PX4 log (ULog)", "export the topic with ulog2csv"}},
    {0, "\xa3\x95\x80"sv, {"an ArduPilot log (.bin)", "export it with mavlogdump.py --format csv"}},
    {0, "CDF\x01"sv, {"a netCDF file of the classic format", "convert it to netCDF-4, which is HDF5"}},
    {0, "CDF\x02"sv, {"a netCDF file of the classic format", "convert it to netCDF-4, which is HDF5"}},
    {0, "CDF\x05"sv, {"a netCDF file of the classic format", "convert it to netCDF-4, which is HDF5"}},
    {0, "SIMPLE  ="sv, {"a FITS file", export_it}},
    {0, "\xd4\xc3\xb2\xa1"sv, {"a capture of network packets (pcap)", "export the payload as CSV"}},
    {0, "\xa1\xb2\xc3\xd4"sv, {"a capture of network packets (pcap)", "export the payload as CSV"}},
    {0, "\x4d\x3c\xb2\xa1"sv, {"a capture of network packets (pcap)", "export the payload as CSV"}},
    {0, "\x0a\x0d\x0d\x0a"sv, {"a capture of network packets (pcapng)", "export the payload as CSV"}},
    {0, "\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"sv, {"an old Office file (such as .xls)", "save the sheet as CSV"}},
    {0, "%PDF-"sv, {"a PDF document", "find the numbers as text"}},
    {0, "\x89PNG\r\n\x1a\n"sv, {"a PNG picture", "find the numbers as text"}},
    {0, "\xff\xd8\xff"sv, {"a JPEG picture", "find the numbers as text"}},
    {0, "GIF8"sv, {"a GIF picture", "find the numbers as text"}},
    {0, "RIFF"sv, {"a RIFF file (such as .wav)", export_it}},
    {0,
     "\x7f"
     "ELF"sv,
     {"a program (ELF)", "name the file with the numbers"}},
    {0, "{\\rtf"sv, {"a formatted document (RTF)", "save it as plain text"}},
    {0, "<?xml"sv, {"XML", export_it}},
    {0, "<!DOCTYPE"sv, {"a web page (HTML)", "download the data themselves"}},
    {0, "<html"sv, {"a web page (HTML)", "download the data themselves"}},
    {0, "\xff\xfe\0\0"sv, {"text in UTF-32", "save it as UTF-8"}},
    {0, "\0\0\xfe\xff"sv, {"text in UTF-32", "save it as UTF-8"}},
};

/// Archives of the format zip are distinguished by the names of their first members.
Identity identify_zip(std::string_view first) {
    if (first.find(".npy") != std::string_view::npos) {
        return {"a NumPy archive (.npz)", "save the arrays with numpy.savetxt, or as HDF5"};
    }
    for (const std::string_view name : {"[Content_Types].xml"sv, "_rels/"sv, "xl/"sv}) {
        if (first.find(name) != std::string_view::npos) {
            return {"an Office file (such as .xlsx)", "save the sheet as CSV"};
        }
    }
    return {"a zip archive", unpack_it};
}

}  // namespace

Identity identify(std::string_view first) {
    if (first.starts_with("PK\x03\x04") || first.starts_with("PK\x05\x06")) return identify_zip(first);
    for (const Magic& magic : magics) {
        if (first.size() < magic.at) continue;
        if (first.substr(magic.at).starts_with(magic.bytes)) return magic.identity;
    }
    return {};
}

}  // namespace ringlock::text
