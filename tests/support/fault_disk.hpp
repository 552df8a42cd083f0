#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

struct sqlite3_vfs;

namespace fiducap::test {

/// A disk in memory that SQLite writes to while this lives, and that fails as disks do: SQLite's
/// default VFS. Files of the system are not seen. One connection per file at a time.
///
/// What was written is volatile until it is synced. A power cut keeps of the volatile writes a
/// random choice, whole, cut at a sector, or none, in any order, as caches do.
class FaultDisk final {
 public:
  enum class Fault {
    kNone,
    kPowerCut,    ///< The step does not happen, and nothing after it until `reboot`.
    kFull,        ///< No room, from this step on until `recover`.
    kSyncFails,   ///< Only this step, if it is a sync: its writes stay volatile.
    kWriteFails,  ///< Only this step, if it is a write: half of it is written.
    kReadFails    ///< Reads fail from this step on until `recover`.
  };

  FaultDisk();
  ~FaultDisk();
  FaultDisk(const FaultDisk&) = delete;
  FaultDisk& operator=(const FaultDisk&) = delete;

  /// Steps are writes, syncs, cuts and deletions; with `kReadFails` reads.
  [[nodiscard]] std::uint64_t steps() const { return steps_; }
  [[nodiscard]] std::uint64_t reads() const { return reads_; }
  /// @param step  counted from now, 0: the next one
  void fail_at(std::uint64_t step, Fault fault);
  /// There is room, and reads succeed.
  void recover();
  /// The disk after the power cut; without one the power is cut now. Another seed gives another
  /// outcome of the same cut.
  void reboot(std::uint32_t seed);
  /// Called at each sync, before it is done.
  void on_sync(std::function<void()> call) { on_sync_ = std::move(call); }

  /// The fault occurred.
  [[nodiscard]] bool has_failed() const { return failed_; }
  /// As programs see it; empty when it is not there.
  [[nodiscard]] std::string content(const std::string& path) const;
  void set_content(const std::string& path, const std::string& bytes);

 private:
  friend struct DiskCalls;
  struct Write {
    std::size_t at{};
    std::string bytes;
    bool cuts{};  ///< The file ends at `at` after it.
  };
  struct File {
    std::string now;      ///< As programs see it.
    std::string durable;  ///< After any power cut.
    std::vector<Write> volatile_writes{};
    std::shared_ptr<File>
        former{};    ///< Deleted, of the same name; may return when neither was synced.
    bool deleted{};  ///< After a power cut only when `durable` is empty.
    int sharers{};   ///< Connections with a lock.
    std::vector<std::unique_ptr<char[]>> shared{};  ///< Memory of the connections (WAL index).
  };

  /// @param possible  what a fault may do to this kind of step, besides power cuts
  /// @return the fault of this step
  Fault step(Fault possible);
  bool read_fails();
  static void apply(std::string& bytes, const Write& write);
  static void apply_torn(std::string& bytes, const Write& write, const std::function<bool()>& keep);
  [[nodiscard]] std::shared_ptr<File> find(const std::string& path) const;

  std::unique_ptr<sqlite3_vfs> vfs_;
  sqlite3_vfs* before_;
  std::map<std::string, std::shared_ptr<File>> files_;
  std::map<std::string, std::shared_ptr<File>> at_cut_;
  std::uint64_t steps_{0};
  std::uint64_t reads_{0};
  std::uint64_t fault_at_{~std::uint64_t{0}};
  Fault fault_{Fault::kNone};
  bool off_{false};
  bool full_{false};
  bool unreadable_{false};
  bool failed_{false};
  std::function<void()> on_sync_;
};

}  // namespace fiducap::test
