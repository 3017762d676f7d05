#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace tubetrack::test {

struct ProgramEnd {
  int exit_code = -1;  ///< −signal where one ended it
  std::string out;
  std::string err;

  std::vector<std::string> out_lines() const;
  /// stderr without the lines that begin with "note: ".
  std::vector<std::string> error_lines() const;
};

/// The built tubetrack as another process; its output is kept in `folder`.
class Program {
 public:
  Program(const std::filesystem::path& folder, std::vector<std::string> arguments);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void send(int signal) const;
  bool running();
  ProgramEnd wait();

 private:
  std::filesystem::path folder_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

std::string read_text(const std::filesystem::path& path);
std::vector<std::string> lines_of(const std::string& text);

}  // namespace tubetrack::test
