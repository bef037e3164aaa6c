#pragma once
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "engine/store/guard.hpp"

/// HDF5 files with typed datasets and attributes.
///
/// Every dataset carries its unit and a description. Object headers hold no times, so that equal data make equal files.
/// All calls go through one lock: objects may be used from any thread, one call runs at a time.
///
/// Errors name the file and the object. InputError: not an HDF5 file, something missing or of another type or shape.
/// RunError: the disk refused.
namespace ringlock::store {

/// Reference to an open HDF5 object, closed on destruction.
class Id {
   public:
    Id() = default;
    explicit Id(std::int64_t value) : value_(value) {}
    Id(Id&& other) noexcept;
    Id& operator=(Id&& other) noexcept;
    ~Id();
    std::int64_t get() const { return value_; }
    bool valid() const { return value_ >= 0; }

   private:
    std::int64_t value_ = -1;
};

/// Types of the elements of datasets and attributes. They are stored as little-endian IEEE double, little-endian
/// integers, and UTF-8 strings of variable length.
template <class T>
concept Element = std::same_as<T, double> || std::same_as<T, std::int64_t> || std::same_as<T, std::uint64_t> ||
    std::same_as<T, std::int8_t> || std::same_as<T, std::string>;

/// Extent of a dataset: {} (scalar, read only), {n} or {rows, columns}.
using Shape = std::vector<std::uint64_t>;

/// Unit and meaning of the numbers. The unit of a pure number is "1", that of text "".
struct Label {
    std::string unit;
    std::string description;
};

/// Common base of groups and datasets: a location and attributes.
class Node {
   public:
    const std::string& file() const { return file_; }
    const std::string& path() const { return path_; }

    /// Sets an attribute, replacing one of that name.
    void set_attribute(const std::string& name, std::string_view value);
    void set_attribute(const std::string& name, double value);
    void set_attribute(const std::string& name, const std::vector<double>& values);
    template <std::integral T>
    void set_attribute(const std::string& name, T value) {
        if constexpr (std::is_signed_v<T>)
            set_signed(name, value);
        else
            set_unsigned(name, value);
    }

    bool has_attribute(const std::string& name) const;
    /// Sorted.
    std::vector<std::string> attribute_names() const;

    std::string string_attribute(const std::string& name) const;
    double double_attribute(const std::string& name) const;  ///< of an integer attribute too
    std::int64_t int_attribute(const std::string& name) const;
    std::uint64_t uint_attribute(const std::string& name) const;
    std::vector<double> doubles_attribute(const std::string& name) const;

   protected:
    Node(Id id, std::string file, std::string path);
    const Id& id() const { return id_; }

   private:
    void set_signed(const std::string& name, std::int64_t value);
    void set_unsigned(const std::string& name, std::uint64_t value);

    Id id_;
    std::string file_;
    std::string path_;
};

/// A dataset of an open file.
class Dataset : public Node {
   public:
    const Shape& shape() const { return shape_; }
    std::string unit() const;         ///< empty where a foreign file gives none
    std::string description() const;  ///< likewise
    /// Whether read() reads it into T.
    template <Element T>
    bool holds() const;

    /// Whole dataset, rows one after the other.
    template <Element T>
    void write(std::span<const T> values);
    /// Rows [first_row, first_row + n_rows), of all columns.
    template <Element T>
    void write_rows(std::uint64_t first_row, std::uint64_t n_rows, std::span<const T> values);

    /// Columns [first_column, first_column + n_columns) of rows [first_row, first_row + n_rows) of a dataset of two
    /// dimensions, rows one after the other.
    template <Element T>
    void write_block(std::uint64_t first_row, std::uint64_t n_rows, std::uint64_t first_column, std::uint64_t n_columns,
                     std::span<const T> values);

    /// Reads numbers only into a type that holds all values of the stored one (any number into double).
    template <Element T>
    std::vector<T> read() const;
    template <Element T>
    std::vector<T> read_rows(std::uint64_t first_row, std::uint64_t n_rows) const;
    /// The part that write_block() writes.
    template <Element T>
    std::vector<T> read_block(std::uint64_t first_row, std::uint64_t n_rows, std::uint64_t first_column,
                              std::uint64_t n_columns) const;

   private:
    friend class Group;
    Dataset(Id id, std::string file, std::string path);
    static Dataset opened(Id id, std::string file, std::string path);
    struct Selection;
    Selection select(std::uint64_t first_row, std::uint64_t n_rows) const;
    Selection select(std::uint64_t first_row, std::uint64_t n_rows, std::uint64_t first_column,
                     std::uint64_t n_columns) const;
    Selection select_all() const;
    template <Element T>
    void write_selection(const Selection& selection, std::span<const T> values);
    template <Element T>
    std::vector<T> read_selection(const Selection& selection) const;

    Shape shape_;
    bool is_plain_ = false;  // one block of numbers in the file, see Storage
};

/// A group of an open file. Names may be paths below it ("arms/ideal").
class Group : public Node {
   public:
    /// Creates the group, and those on the way to it; it must not exist.
    Group create_group(const std::string& name);
    Group group(const std::string& name) const;
    Dataset dataset(const std::string& name) const;

    /// These throw InputError where the name leads to another file, see Links.
    bool has(const std::string& name) const;
    bool has_group(const std::string& name) const;
    bool has_dataset(const std::string& name) const;
    /// Names of its members, links that lead nowhere included, sorted.
    std::vector<std::string> children() const;

    /// Creates a dataset whose space on the disk is taken at once (a full disk shows here); rows not yet written are
    /// NaN, 0 or "".
    template <Element T>
    Dataset create_dataset(const std::string& name, const Shape& shape, const Label& label);
    /// Creates a dataset that is stored in compressed chunks of so many rows. Write whole chunks, and once: each goes
    /// to the disk as it is written, and is compressed anew where it is written again.
    template <Element T>
    Dataset create_chunked(const std::string& name, const Shape& shape, std::uint64_t chunk_rows, const Label& label);
    /// Creates a dataset and writes it; of rank 1 where no shape is given.
    template <Element T>
    Dataset write(const std::string& name, std::span<const T> values, const Label& label);
    template <Element T>
    Dataset write(const std::string& name, std::span<const T> values, const Shape& shape, const Label& label);
    template <Element T>
    Dataset write(const std::string& name, const std::vector<T>& values, const Label& label) {
        return write(name, std::span<const T>(values), label);
    }

   protected:
    Group(Id id, std::string file, std::string path);

   private:
    enum class Space { at_once, on_writing, in_chunks };
    template <Element T>
    Dataset make_dataset(const std::string& name, const Shape& shape, const Label& label, Space space,
                         std::uint64_t chunk_rows = 0);
    std::string child_path(const std::string& name) const;
    Id open(const std::string& name, bool want_group) const;
    /// Kind of the object as HDF5 numbers kinds, negative if there is no object. Throws InputError where a link to it
    /// leads to another file and is not followed. Under the lock.
    int type_in_this_file(const std::string& name) const;
};

/// An HDF5 file and its root group.
class File : public Group {
   public:
    /// Creates the file, or empties one that is there. Errors call it `shown_as`. See AtomicFile for results.
    static File create(const std::filesystem::path& path, const std::filesystem::path& shown_as);
    static File create(const std::filesystem::path& path) { return create(path, path); }
    /// Opens for reading, within guarded().
    static File open(const GuardedPath& guarded_path);

    /// Number of the file in the HDF5 library, for readers that need functions which this interface does not have.
    std::int64_t library_id() const { return file_id_.get(); }

    /// Brings everything to the disk and closes; nothing of the file can be used after. Throws RunError where the disk
    /// refuses. The destructor closes too but cannot report.
    void close();

   private:
    File(Id file, Id root, std::string path);
    Id file_id_;
};

}  // namespace ringlock::store
