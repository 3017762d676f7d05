#include "emulated_machine/usb_camera.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "emulated_machine/usb_descriptors.hpp"

namespace tubetrack::test {

namespace {

// Of USB/IP.
constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitted = 3, kUnlinked = 4;
constexpr std::uint32_t kFromDevice = 1;
constexpr const char* kHub = "/sys/devices/platform/vhci_hcd.0/";
constexpr int kPort = 0, kDevice = 0x10001, kHighSpeed = 3;
// Of the kernel's errno.
constexpr int kStall = -32, kReset = -104;

constexpr std::size_t kPayloadHeader = 12;

bool read_all(int socket, void* to, std::size_t bytes) {
  auto* at = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t got = recv(socket, at, bytes, 0);
    if (got <= 0) return false;
    at += got;
    bytes -= static_cast<std::size_t>(got);
  }
  return true;
}

void write_all(int socket, const void* from, std::size_t bytes) {
  const auto* at = static_cast<const char*>(from);
  while (bytes > 0) {
    const ssize_t put = send(socket, at, bytes, MSG_NOSIGNAL);
    if (put <= 0) return;  // unplugged
    at += put;
    bytes -= static_cast<std::size_t>(put);
  }
}

}  // namespace

std::uint16_t usb_camera_pixel(int number, int u, int v, int width, int height) {
  if (u == 0 && v == 0) return static_cast<std::uint16_t>(number & 0xfff);
  // The ray (·, y, 1) z meets a cylinder of radius R about the line y = 0, z = d.
  constexpr double kRadius_mm = 40.0, kDistance_mm = 600.0, kWall_mm = 900.0;
  const double y = (v - 0.5 * (height - 1)) / (0.9 * width);
  const double a = y * y + 1.0;
  const double root = kDistance_mm * kDistance_mm - a * (kDistance_mm * kDistance_mm - kRadius_mm * kRadius_mm);
  const bool tube = root > 0.0 && u > width / 8 && u < width - width / 8;
  const double depth_mm = tube ? (kDistance_mm - std::sqrt(root)) / a : kWall_mm;
  const std::uint32_t hash = static_cast<std::uint32_t>((number * height + v) * width + u) * 2654435761U;
  return static_cast<std::uint16_t>(std::lround(depth_mm) + static_cast<long>((hash >> 16) % 3) - 1);
}

UsbCamera::UsbCamera(const UsbCameraSettings& settings) : settings_(settings) {
  int ends[2] = {};
  if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0) throw std::runtime_error("no socket for the camera");
  socket_ = ends[0];
  const auto attach = [&] {
    std::ofstream file(std::string(kHub) + "attach");
    file << kPort << ' ' << ends[1] << ' ' << kDevice << ' ' << kHighSpeed << std::flush;
    return static_cast<bool>(file);
  };
  bool attached = attach();
  // The port is free again only some time after the camera before was unplugged.
  for (int tries = 0; !attached && tries < 50; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    attached = attach();
  }
  close(ends[1]);  // the kernel has its own
  if (!attached) throw std::runtime_error("the kernel takes no camera: module vhci-hcd, and root?");
  requests_thread_ = std::thread([this] { answer_requests(); });
  frames_thread_ = std::thread([this] { send_frames(); });
}

UsbCamera::~UsbCamera() {
  std::ofstream(std::string(kHub) + "detach") << kPort << std::flush;
  shutdown(socket_, SHUT_RDWR);
  requests_thread_.join();
  frames_thread_.join();
  close(socket_);
}

int UsbCamera::bits() const {
  return bits_per_pixel(settings_.formats.at(format_ - 1U));
}

void UsbCamera::answer_requests() {
  Header header{};
  while (read_all(socket_, header.data(), sizeof header)) {
    std::array<std::uint8_t, 8> setup{};
    std::memcpy(setup.data(), &header[10], setup.size());
    for (std::uint32_t& word : header) word = ntohl(word);
    const std::uint32_t sequence = header[1];
    if (header[0] == kUnlink) {
      cancel(sequence, header[5]);
      continue;
    }
    if (header[0] != kSubmit) break;
    const std::uint32_t length = header[6];
    if (header[4] == 1) {  // the endpoint of the pixels
      const std::lock_guard lock(mutex_);
      requests_.push_back({sequence, length});
      changed_.notify_all();
      continue;
    }
    Bytes sent(header[3] == kFromDevice ? 0 : length);
    if (!read_all(socket_, sent.data(), sent.size())) break;
    answer_control(sequence, setup, sent);
  }
  const std::lock_guard lock(mutex_);
  unplugged_ = true;
  changed_.notify_all();
}

/// What the stream is set to, as the kernel asks for it and sets it.
UsbCamera::Bytes UsbCamera::stream_state() const {
  const auto image_bytes = static_cast<std::uint32_t>(settings_.width * settings_.height * bits() / 8);
  Bytes all;
  append(all, 0, 2);
  append(all, format_, 1);
  append(all, 1, 1);
  append(all, 10000000U / static_cast<std::uint32_t>(settings_.frames_per_second), 4);
  all.resize(all.size() + 10);
  append(all, image_bytes, 4);
  append(all, kPayloadBytes, 4);
  append(all, 48000000, 4);
  append(all, 0, 4);
  return all;
}

void UsbCamera::answer_control(std::uint32_t sequence, const std::array<std::uint8_t, 8>& setup, const Bytes& sent) {
  constexpr int kGetDescriptor = 6, kGetLength = 0x85, kGetInfo = 0x86;
  const int type = setup[0];
  const int request = setup[1];
  const int index = setup[2];
  const int what = setup[3];
  const auto asked = static_cast<std::size_t>(setup[6] | setup[7] << 8);
  Bytes data;
  int status = 0;
  if (type == 0x80 && request == kGetDescriptor && what >= 1 && what <= 3) {
    data = what == 1 ? device_descriptor() : what == 2 ? configuration_descriptor(settings_) : string_descriptor(index);
  } else if (type == 0x80 && request == 0) {
    data = {0, 0};
  } else if ((type & 0x7f) == 0x21 && setup[4] == 1) {  // of the streaming interface
    const std::lock_guard lock(mutex_);
    if (type == 0x21) {
      if (sent.size() > 2 && sent[2] >= 1 && sent[2] <= settings_.formats.size()) format_ = sent[2];
    } else {
      data = request == kGetLength ? Bytes{34, 0} : request == kGetInfo ? Bytes{3} : stream_state();
    }
  } else if (type > 2) {
    status = kStall;  // it has no such control
  }
  data.resize(std::min(data.size(), asked));
  const bool to_device = (type & 0x80) == 0;
  reply(sequence, status, data, static_cast<std::uint32_t>(to_device ? sent.size() : data.size()));
}

void UsbCamera::cancel(std::uint32_t sequence, std::uint32_t cancelled) {
  std::size_t found = 0;
  {
    const std::lock_guard lock(mutex_);
    found = std::erase_if(requests_, [&](const Request& request) { return request.sequence == cancelled; });
    ++cancellations_;
    changed_.notify_all();
  }
  Header header{kUnlinked, sequence};
  header[5] = static_cast<std::uint32_t>(found > 0 ? kReset : 0);
  for (std::uint32_t& word : header) word = htonl(word);
  const std::lock_guard lock(write_mutex_);
  write_all(socket_, header.data(), sizeof header);
}

void UsbCamera::reply(std::uint32_t sequence, int status, const Bytes& data, std::uint32_t length) {
  Header header{kSubmitted, sequence};
  header[5] = static_cast<std::uint32_t>(status);
  header[6] = length;
  for (std::uint32_t& word : header) word = htonl(word);
  const std::lock_guard lock(write_mutex_);
  write_all(socket_, header.data(), sizeof header);
  write_all(socket_, data.data(), data.size());
}

/// Frames at their rate for as long as the kernel asks for pixels.
void UsbCamera::send_frames() {
  const auto interval = std::chrono::microseconds(1000000 / settings_.frames_per_second);
  auto next = std::chrono::steady_clock::now();
  for (int number = 0;;) {
    std::size_t pixel_bytes = 0;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return unplugged_ || !requests_.empty(); });
      if (unplugged_) return;
      pixel_bytes = static_cast<std::size_t>(bits() / 8);
    }
    Bytes pixels;
    pixels.reserve(static_cast<std::size_t>(settings_.width * settings_.height) * pixel_bytes);
    for (int v = 0; v < settings_.height; ++v) {
      for (int u = 0; u < settings_.width; ++u) {
        append(pixels, usb_camera_pixel(number, u, v, settings_.width, settings_.height),
               static_cast<int>(pixel_bytes));
      }
    }
    next = std::max(next + interval, std::chrono::steady_clock::now());
    std::this_thread::sleep_until(next);
    if (send_frame(pixels, number % 2 != 0)) ++number;
  }
}

/// False where the kernel stopped asking in the middle of it.
bool UsbCamera::send_frame(const Bytes& pixels, bool odd) {
  constexpr std::uint8_t kEndOfHeader = 0x80, kEndOfFrame = 2;
  std::unique_lock lock(mutex_);
  const std::uint32_t cancellations = cancellations_;
  for (std::size_t at = 0; at < pixels.size();) {
    changed_.wait(lock, [&] { return unplugged_ || cancellations_ != cancellations || !requests_.empty(); });
    if (unplugged_ || cancellations_ != cancellations) return false;
    const Request request = requests_.front();
    requests_.pop_front();
    const std::size_t part =
        std::min({pixels.size() - at, request.bytes - kPayloadHeader, std::size_t{kPayloadBytes} - kPayloadHeader});
    Bytes payload(kPayloadHeader);
    payload[0] = kPayloadHeader;
    payload[1] =
        static_cast<std::uint8_t>(kEndOfHeader | (odd ? 1 : 0) | (at + part == pixels.size() ? kEndOfFrame : 0));
    payload.insert(payload.end(), pixels.begin() + static_cast<std::ptrdiff_t>(at),
                   pixels.begin() + static_cast<std::ptrdiff_t>(at + part));
    at += part;
    lock.unlock();
    reply(request.sequence, 0, payload, static_cast<std::uint32_t>(payload.size()));
    lock.lock();
  }
  return true;
}

}  // namespace tubetrack::test
