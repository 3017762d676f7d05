#include "apps/program.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace tubetrack::test {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string read_text(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> ProgramEnd::out_lines() const {
  return lines_of(out);
}

std::vector<std::string> ProgramEnd::error_lines() const {
  std::vector<std::string> lines = lines_of(err);
  std::erase_if(lines, [](const std::string& line) { return line.starts_with("note: "); });
  return lines;
}

Program::Program(const std::filesystem::path& folder, std::vector<std::string> arguments) : folder_(folder) {
  arguments.insert(arguments.begin(), TUBETRACK_PROGRAM);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const std::string out = folder_ / "stdout.txt", err = folder_ / "stderr.txt";
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("fork failed");
  if (pid_ > 0) return;
  constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
  dup2(open(out.c_str(), kFlags, 0600), STDOUT_FILENO);
  dup2(open(err.c_str(), kFlags, 0600), STDERR_FILENO);
  execv(argv[0], argv.data());
  _exit(127);
}

Program::~Program() {
  if (ended_) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, &status_, 0);
}

void Program::send(int signal) const {
  kill(pid_, signal);
}

bool Program::running() {
  if (!ended_) ended_ = waitpid(pid_, &status_, WNOHANG) == pid_;
  return !ended_;
}

ProgramEnd Program::wait() {
  if (!ended_) waitpid(pid_, &status_, 0);
  ended_ = true;
  ProgramEnd end;
  end.exit_code = WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
  end.out = read_text(folder_ / "stdout.txt");
  end.err = read_text(folder_ / "stderr.txt");
  return end;
}

}  // namespace tubetrack::test
