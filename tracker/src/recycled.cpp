#include "tubetrack/tracker/recycled.hpp"

#include <array>
#include <bit>
#include <new>

namespace tubetrack {

namespace {

constexpr std::size_t kLeastBits = 6;  // blocks are of 2^6 bytes and more, so that they hold a pointer and are aligned
constexpr std::size_t kMostBits = 26;  // 64 MB; what is larger is the system's
// Of small blocks, to 512 bytes, some are taken ahead: how many are in use at once varies a little.
constexpr std::size_t kSmallBits = 9;
constexpr int kSparesAhead = 15;
constexpr std::align_val_t kAlignment{64};

// Sanitizers see what is used after it was given back only where it really is freed.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kKeeps = false;
#else
constexpr bool kKeeps = true;
#endif

std::size_t bits_of(std::size_t bytes) {
  return bytes <= (std::size_t{1} << kLeastBits) ? kLeastBits : std::bit_width(bytes - 1);
}

/// A block that nobody has begins with where the next one of its size is.
struct Spare {
  Spare* next;
};

// Set once the thread's shelf is gone: what is given back by what lives longer is freed.
thread_local bool shelf_is_gone = false;

/// What a thread keeps.
struct Shelf {
  std::array<Spare*, kMostBits + 1> first{};

  Shelf() = default;
  Shelf(const Shelf&) = delete;
  Shelf& operator=(const Shelf&) = delete;
  ~Shelf() {
    shelf_is_gone = true;
    for (Spare* spare : first) {
      while (spare) ::operator delete(std::exchange(spare, spare->next), kAlignment);
    }
  }
};

Spare** spares_of(std::size_t bits) {
  if (!kKeeps || bits > kMostBits || shelf_is_gone) return nullptr;
  thread_local Shelf shelf;
  return &shelf.first[bits];
}

}  // namespace

void* take_memory(std::size_t bytes) {
  if (bytes == 0) return nullptr;
  const std::size_t bits = bits_of(bytes);
  const std::size_t size = std::size_t{1} << bits;
  Spare** const spares = spares_of(bits);
  if (spares && *spares) return std::exchange(*spares, (*spares)->next);
  if (spares && bits <= kSmallBits) {
    for (int i = 0; i < kSparesAhead; ++i) *spares = new (::operator new(size, kAlignment)) Spare{*spares};
  }
  return ::operator new(size, kAlignment);
}

void give_back_memory(void* memory, std::size_t bytes) noexcept {
  if (!memory) return;
  Spare** const spares = spares_of(bits_of(bytes));
  if (!spares) {
    ::operator delete(memory, kAlignment);
    return;
  }
  *spares = new (memory) Spare{*spares};
}

}  // namespace tubetrack
