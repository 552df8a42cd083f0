#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <optional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "base/time.hpp"

namespace fiducap {

/// Faults of a network; shares are from 0 to 1.
struct LinkFaults {
  double lost{};
  double twice{};
  double shortened{};      ///< Cut anywhere: by a broken tunnel, not by UDP.
  Duration least_delay{};  ///< Of each datagram, so that they overtake each other.
  Duration most_delay{};
  double late{};  ///< Delayed by another `very_late`.
  Duration very_late{};

  /// A network drawn at random.
  static LinkFaults drawn(std::mt19937& random) {
    const auto upto = [&](double most) {
      return std::uniform_real_distribution(0.0, most)(random);
    };
    const auto ms = [&](double most) { return from_seconds(1e-3 * upto(most)); };
    const Duration least = ms(20);
    return {upto(0.6), upto(0.4), upto(0.1), least, least + ms(80), upto(0.05), ms(1500)};
  }
};

/// Datagrams one way, in virtual time.
class FaultyLink final {
 public:
  using Bytes = std::vector<std::byte>;

  /// @param random  outlives the link
  FaultyLink(std::mt19937& random, const LinkFaults& faults) : random_(random), faults_(faults) {}

  void set(const LinkFaults& faults) { faults_ = faults; }
  void send(std::span<const std::byte> datagram, Instant now) {
    if (happens(faults_.lost)) return;
    put(datagram, now);
    if (happens(faults_.twice)) put(datagram, now);
  }
  /// The next one that has arrived.
  [[nodiscard]] std::optional<Bytes> receive(Instant now) {
    if (on_the_way_.empty() || on_the_way_.begin()->first > now) return std::nullopt;
    Bytes datagram = std::move(on_the_way_.begin()->second);
    on_the_way_.erase(on_the_way_.begin());
    return datagram;
  }

 private:
  bool happens(double share) { return std::uniform_real_distribution(0.0, 1.0)(random_) < share; }
  void put(std::span<const std::byte> datagram, Instant now) {
    Bytes bytes(datagram.begin(), datagram.end());
    if (!bytes.empty() && happens(faults_.shortened)) bytes.resize(random_() % bytes.size());
    Duration delay = faults_.least_delay;
    if (faults_.most_delay > delay)
      delay += Duration{static_cast<std::int64_t>(
          random_() % static_cast<std::uint64_t>((faults_.most_delay - delay).count()))};
    if (happens(faults_.late)) delay += faults_.very_late;
    on_the_way_.emplace(now + delay, std::move(bytes));
  }

  std::mt19937& random_;
  LinkFaults faults_;
  std::multimap<Instant, Bytes> on_the_way_;
};

/// A stream one way, in virtual time: nothing is lost and the order is kept, but it arrives in
/// pieces cut anywhere, and late. A connection that breaks is a new stream.
class FaultyStream final {
 public:
  explicit FaultyStream(std::mt19937& random, Duration most_delay)
      : random_(random), most_delay_(most_delay) {}

  void set(Duration most_delay) { most_delay_ = most_delay; }
  void send(std::span<const std::byte> bytes, Instant now) {
    if (bytes.empty()) return;
    const auto spread = static_cast<std::uint64_t>(std::max<std::int64_t>(most_delay_.count(), 1));
    newest_ = std::max(newest_, now + Duration{static_cast<std::int64_t>(random_() % spread)});
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    arrives_.emplace_back(newest_, bytes.size());
  }
  /// A piece of what has arrived; empty: nothing has.
  [[nodiscard]] std::vector<std::byte> receive(Instant now) {
    while (!arrives_.empty() && arrives_.front().first <= now) {
      arrived_ += arrives_.front().second;
      arrives_.erase(arrives_.begin());
    }
    if (arrived_ == 0) return {};
    const std::size_t size = 1 + random_() % arrived_;
    std::vector<std::byte> piece(buffer_.begin(),
                                 buffer_.begin() + static_cast<std::ptrdiff_t>(size));
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(size));
    arrived_ -= size;
    return piece;
  }

 private:
  std::mt19937& random_;
  Duration most_delay_;
  Instant newest_{};
  std::vector<std::byte> buffer_;
  std::size_t arrived_{0};
  std::vector<std::pair<Instant, std::size_t>> arrives_;
};

/// Number of seeds of a test of the network: FIDUCAP_SEEDS, or 100.
inline std::uint32_t seeds() {
  const char* requested = std::getenv("FIDUCAP_SEEDS");
  return requested == nullptr ? 100 : static_cast<std::uint32_t>(std::atol(requested));
}

}  // namespace fiducap
