#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "tubetrack/sensors/error.hpp"

namespace tubetrack {

/// Another program of this project in a process of its own, for what may crash or take long: the running one is not
/// hurt. Its standard input and output are one socket, whose other end is here; what it says on stderr is not shown. It
/// lies in the folder of the running program.
class ChildProcess {
 public:
  /// The path that `name` would have; empty where it is not there.
  static std::string beside_us(const std::string& name);
  /// The error says that the program is not there or can't be started.
  static Expected<ChildProcess> start(const std::string& name, const std::vector<std::string>& arguments);

  ChildProcess(ChildProcess&& other) noexcept
      : pid_(std::exchange(other.pid_, -1)), socket_(std::exchange(other.socket_, -1)) {}
  ChildProcess& operator=(ChildProcess&& other) noexcept;
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  /// Ends it, whatever it does.
  ~ChildProcess();

  /// All of the bytes; false where it is gone.
  bool send(const void* from, std::size_t bytes) const;
  /// All of the bytes; false where it is gone before. Waits for as long as it takes.
  bool receive(void* to, std::size_t bytes) const;
  /// There is something to receive, or it is gone, within `patience`.
  bool ready(std::chrono::milliseconds patience) const;
  /// It has closed its end.
  bool gone() const;
  /// From any thread: send and receive return at once from here on.
  void hang_up() const;

 private:
  ChildProcess(pid_t pid, int socket) : pid_(pid), socket_(socket) {}

  pid_t pid_ = -1;
  int socket_ = -1;
};

/// In such a process: all of the bytes that the program which started it sends; false where that is gone.
bool receive_from_parent(void* to, std::size_t bytes);

}  // namespace tubetrack
