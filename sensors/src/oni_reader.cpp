// tubetrack_oni_reader: decodes an .oni file for another program, so that it is this process that a damaged file takes
// down. Started by open_oni_file; speaks oni_process.hpp on standard input and output.
#include <unistd.h>

#include <chrono>
#include <string>

#include "oni_process.hpp"
#include "tubetrack/sensors/child_process.hpp"

namespace tubetrack {

namespace {

/// To the program; where that is gone there is nothing left to do.
void put(int to, const void* from, std::size_t bytes) {
  const auto* at = static_cast<const char*>(from);
  while (bytes > 0) {
    const ssize_t written = write(to, at, bytes);
    if (written <= 0) _exit(0);
    at += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

void read_file(int to, const OniRequest& request, const std::string& path) {
  OpenNi2Options options;
  if (request.has_intrinsics) options.intrinsics_px = request.intrinsics_px;
  const auto file = open_oni_file_here(path, options);
  OniOpened opened;
  const std::string error = file ? "" : file.error().message;
  opened.error_bytes = static_cast<std::uint32_t>(error.size());
  if (file) {
    opened.intrinsics = (*file)->info().intrinsics;
    opened.metres_per_unit = (*file)->info().metres_per_unit;
    opened.frame_count = (*file)->info().frame_count.value_or(0);
  }
  put(to, &opened, sizeof opened);
  put(to, error.data(), error.size());
  if (!file) return;
  OniFrame head;
  while (head.outcome != FrameOutcome::end_of_stream) {
    DepthFrame frame;
    head.outcome = (*file)->next(frame, std::chrono::seconds{2});
    if (head.outcome == FrameOutcome::timeout) continue;
    const std::string problem = head.outcome == FrameOutcome::corrupt ? (*file)->last_problem() : "";
    head.index = frame.index;
    head.timestamp_s = frame.timestamp_s;
    head.problem_bytes = static_cast<std::uint32_t>(problem.size());
    put(to, &head, sizeof head);
    put(to, problem.data(), problem.size());
    if (head.outcome != FrameOutcome::ok) continue;
    put(to, frame.pixels, frame.stride_bytes * static_cast<std::size_t>(frame.height));
  }
  _exit(0);  // what the runtime may still do while it closes is of no interest
}

}  // namespace

}  // namespace tubetrack

int main() {
  // What the runtime prints must not come in between.
  const int to = dup(STDOUT_FILENO);
  dup2(STDERR_FILENO, STDOUT_FILENO);
  tubetrack::OniRequest request;
  if (!tubetrack::receive_from_parent(&request, sizeof request)) return 2;
  std::string path(request.path_bytes, '\0');
  if (!tubetrack::receive_from_parent(path.data(), path.size())) return 2;
  tubetrack::read_file(to, request, path);
  return 0;
}
