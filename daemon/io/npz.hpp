// NumPy's .npz archives: named arrays in a zip file, read with distrust and written so that numpy.load opens them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace booth::daemon {

/// Little-endian element types. Text is fixed-width; zero padding is cut off.
enum class NpzType : std::uint8_t { f2, f4, f8, i4, i8, u1, text };

struct NpzArray {
  NpzType type = NpzType::f4;
  std::vector<std::size_t> shape;  ///< C order
  std::string bytes;               ///< of numbers
  std::vector<std::string> texts;  ///< of NpzType::text

  std::size_t size() const;  ///< number of elements
  /// Element i of a number array as a double.
  double number(std::size_t i) const;
};

/// A file that was read. Every error is a std::runtime_error that names file and key.
class NpzReader {
 public:
  /// Reads and checks the whole archive: sizes, names, checksums, headers. At most 512 MiB unpacked.
  explicit NpzReader(const std::filesystem::path& path);
  /// The same on bytes that are already in memory (`name` goes into errors).
  NpzReader(std::string_view archive, std::string name);

  bool has(const std::string& key) const { return arrays_.contains(key); }
  /// Keys in alphabetical order.
  std::vector<std::string> keys() const;
  /// Throws when the key is missing.
  const NpzArray& array(const std::string& key) const;
  /// Numbers of an array whose shape must be `shape` (0 = any size there). Throws on text, other shapes and values that are not finite.
  std::vector<double> numbers(const std::string& key, std::span<const std::size_t> shape) const;
  std::vector<double> numbers(const std::string& key, std::initializer_list<std::size_t> shape) const {
    return numbers(key, std::span(shape.begin(), shape.size()));
  }
  /// Whole numbers in [low, high].
  std::vector<int> integers(const std::string& key, std::initializer_list<std::size_t> shape, long low, long high) const;
  std::vector<std::string> texts(const std::string& key) const;
  /// A text array of one element.
  std::string text(const std::string& key) const;
  /// "FILE: key 'KEY' WHAT".
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

 private:
  void parse(std::string_view archive);
  std::string name_;
  std::map<std::string, NpzArray> arrays_;
};

/// Collects arrays; the same calls give the same bytes (no time stamps).
class NpzWriter {
 public:
  void add(const std::string& key, NpzType type, std::vector<std::size_t> shape, std::span<const double> values);
  void add_texts(const std::string& key, const std::vector<std::string>& values, bool scalar = false);
  std::string archive() const;
  /// Through AtomicFile, whose errors it throws.
  void save(const std::filesystem::path& path) const;

 private:
  std::vector<std::pair<std::string, std::string>> members_;  // file name in the archive, contents
};

/// A single .npy file; the same distrust. Throws std::runtime_error that names the file.
NpzArray read_npy(const std::filesystem::path& path);

/// IEEE 754 half precision; to nearest even.
std::uint16_t half_from_float(float value);
float float_from_half(std::uint16_t bits);

}  // namespace booth::daemon
