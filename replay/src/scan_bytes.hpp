#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// Carries an error out of a reader up to read_scan, no farther. The text says what is wrong and the fix; read_scan
/// puts the file's path before it.
struct ScanRefusal {
  std::string text;
  Error::Kind kind = Error::Kind::failed;
};

/// Half of the machine's memory.
std::size_t default_memory_limit_bytes();

/// "1.5 GB": bytes for a message.
std::string human_size(double bytes);

/// The whole file. Throws ScanRefusal where it can't be read, is empty or larger than `limit_bytes`.
std::string read_whole_file(const std::filesystem::path& path, std::size_t limit_bytes);

/// The first 64 KB of a file, or all of a shorter one, for a header that is text. Empty where it can't be read.
std::string read_header_text(const std::filesystem::path& path);

/// Cuts a text into lines and words; counts the lines for messages.
class TextCursor {
 public:
  explicit TextCursor(std::string_view text, int first_line = 1) : rest_(text), line_(first_line - 1) {}

  /// The next line without its end, or false at the end of the text.
  bool next_line(std::string_view& line);
  /// The next line that is neither blank nor a comment; what follows `comment` on a line is cut off.
  bool next_content(std::string_view& line, char comment);
  /// Number of the line that was given last, from 1.
  int line() const { return line_; }
  std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
  int line_;
};

/// Cuts the next word off `text`; empty at its end. Blanks and tabs part words: a decimal
/// comma must not turn one number into two.
std::string_view next_word(std::string_view& text);

/// A number that fills the word, also "nan" and "inf"; empty when it is none.
std::optional<double> number_in(std::string_view word);
std::optional<long long> integer_in(std::string_view word);

/// As number_in of the next word. Throws ScanRefusal with the line and the field's name.
double take_number(std::string_view& text, std::string_view field, int line);
long long take_integer(std::string_view& text, std::string_view field, int line);

/// A word for a message: in quotes, cut at 40 characters, without control characters.
std::string in_quotes(std::string_view word);

/// How binary numbers are stored.
enum class NumberType { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };
std::size_t size_of(NumberType type);

/// The number at `bytes`; `swapped`: in the order of the other endianness.
double load_number(const char* bytes, NumberType type, bool swapped);

/// Throws ScanRefusal when `count` things of at least `bytes_each` cannot be in `available` bytes: a header that lies
/// must not make us allocate.
void require_room(std::string_view what, double count, double bytes_each, double available);

}  // namespace tubetrack
