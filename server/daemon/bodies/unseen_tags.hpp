#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "detection/no_tag.hpp"

namespace fiducap {

/// Images of one body without tags, on their way from its worker to the thread that looks at them
/// again, and the reason it found, on its way to the watch. Locks only while no tag is seen.
class UnseenTags final {
 public:
  static constexpr Duration kEvery = std::chrono::seconds(1);
  static constexpr std::size_t kEnough = 5;  ///< Images; fewer seconds without a tag are usual.
  static constexpr Duration kAgain = std::chrono::minutes(1);

  /// By the worker, for every image. @param image  nullptr: corners only
  void note(const SharedImage& image, Instant at, bool has_tags);
  /// The images to look at, once after kEnough × kEvery without a tag, then every kAgain.
  [[nodiscard]] std::vector<SharedImage> take();
  void answer(std::string why);
  /// Empty: tags are seen, or the reason is not known yet.
  [[nodiscard]] std::string why() const;

 private:
  bool sees_tags_{true};            ///< Of the worker.
  std::optional<Instant> kept_at_;  ///< Of the worker.
  mutable std::mutex mutex_;        ///< Protects the rest.
  std::vector<SharedImage> images_;
  std::optional<Instant> taken_at_;
  std::string why_;
};

/// Looks at the images of all bodies again, on a thread of its own.
class SecondLooks final {
 public:
  /// @param why  why_no_tag with the server's configuration
  SecondLooks(std::function<std::string(std::span<const SharedImage>, std::stop_token)> why,
              const Clock& clock)
      : why_(std::move(why)), clock_(clock) {}

  /// @pre it outlives this
  void add(UnseenTags& body) { bodies_.push_back(&body); }
  /// Until stopped.
  void run(std::stop_token stop);
  void look(const std::stop_token& stop);

 private:
  std::function<std::string(std::span<const SharedImage>, std::stop_token)> why_;
  const Clock& clock_;
  std::vector<UnseenTags*> bodies_;
};

}  // namespace fiducap
