#include "support/fault_disk.hpp"

#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace fiducap::test {

/// Functions that SQLite calls.
struct DiskCalls {
  using File = FaultDisk::File;
  using Fault = FaultDisk::Fault;
  static constexpr std::size_t kSector = 512;

  struct Inner {
    FaultDisk* disk{};
    std::shared_ptr<File> file;
    int lock{SQLITE_LOCK_NONE};
  };
  struct Handle {
    sqlite3_file base;  ///< First: SQLite knows only this.
    Inner* inner;
  };

  static FaultDisk& disk_of(sqlite3_vfs* vfs) { return *static_cast<FaultDisk*>(vfs->pAppData); }
  static Inner& in(sqlite3_file* file) { return *reinterpret_cast<Handle*>(file)->inner; }

  // Of the disk.

  static int open(sqlite3_vfs* vfs, const char* name, sqlite3_file* file, int flags, int* given) {
    FaultDisk& disk = disk_of(vfs);
    file->pMethods = nullptr;
    if (disk.off_) return SQLITE_CANTOPEN;
    auto found = name == nullptr ? std::make_shared<File>() : disk.find(name);
    if (!found) {
      if ((flags & SQLITE_OPEN_CREATE) == 0) return SQLITE_CANTOPEN;
      found = std::make_shared<File>();
      found->former = std::exchange(disk.files_[name], found);
    }
    reinterpret_cast<Handle*>(file)->inner = new Inner{&disk, found};
    file->pMethods = methods();
    if (given != nullptr) *given = flags;
    return SQLITE_OK;
  }
  static int remove(sqlite3_vfs* vfs, const char* name, int synced) {
    FaultDisk& disk = disk_of(vfs);
    const Fault fault = disk.step(Fault::kNone);
    if (fault == Fault::kPowerCut) return SQLITE_IOERR_DELETE;
    const auto file = disk.find(name);
    if (!file) return SQLITE_IOERR_DELETE_NOENT;
    file->deleted = true;
    file->now.clear();
    file->volatile_writes.clear();
    if (synced != 0) file->durable.clear();
    return SQLITE_OK;
  }
  static int access(sqlite3_vfs* vfs, const char* name, int, int* there) {
    const auto file = disk_of(vfs).find(name);
    *there = file && !file->now.empty() ? 1 : 0;
    return disk_of(vfs).off_ ? SQLITE_IOERR_ACCESS : SQLITE_OK;
  }
  static int full_name(sqlite3_vfs*, const char* name, int size, char* out) {
    sqlite3_snprintf(size, out, "%s", name);
    return SQLITE_OK;
  }
  static int randomness(sqlite3_vfs*, int size, char* out) {
    static std::mt19937 random(1);
    for (int i = 0; i < size; ++i) out[i] = static_cast<char>(random());
    return size;
  }
  static int sleep(sqlite3_vfs*, int microseconds) { return microseconds; }
  static int time(sqlite3_vfs*, sqlite3_int64* julian_ms) {
    *julian_ms = 212'000'000'000'000;
    return SQLITE_OK;
  }
  static int last_error(sqlite3_vfs*, int, char*) { return 0; }

  // Of a file.

  static int close(sqlite3_file* file) {
    unlock(file, SQLITE_LOCK_NONE);
    delete reinterpret_cast<Handle*>(file)->inner;
    return SQLITE_OK;
  }
  static int read(sqlite3_file* file, void* out, int size, sqlite3_int64 at) {
    if (in(file).disk->read_fails()) return SQLITE_IOERR_READ;
    const std::string& bytes = in(file).file->now;
    const auto from = std::min(static_cast<std::size_t>(at), bytes.size());
    const auto there = std::min(static_cast<std::size_t>(size), bytes.size() - from);
    std::memset(out, 0, static_cast<std::size_t>(size));
    std::memcpy(out, bytes.data() + from, there);
    return there == static_cast<std::size_t>(size) ? SQLITE_OK : SQLITE_IOERR_SHORT_READ;
  }
  static int write(sqlite3_file* file, const void* bytes, int size, sqlite3_int64 at) {
    FaultDisk& disk = *in(file).disk;
    FaultDisk::Write write{
        static_cast<std::size_t>(at),
        std::string(static_cast<const char*>(bytes), static_cast<std::size_t>(size)), false};
    const Fault fault = disk.step(Fault::kWriteFails);
    if (fault == Fault::kPowerCut) return SQLITE_IOERR_WRITE;
    const bool grows = write.at + write.bytes.size() > in(file).file->now.size();
    if (disk.full_ && grows) return disk.failed_ = true, SQLITE_FULL;
    if (fault == Fault::kWriteFails) write.bytes.resize(write.bytes.size() / 2);
    FaultDisk::apply(in(file).file->now, write);
    in(file).file->volatile_writes.push_back(std::move(write));
    return fault == Fault::kWriteFails ? SQLITE_IOERR_WRITE : SQLITE_OK;
  }
  static int cut(sqlite3_file* file, sqlite3_int64 size) {
    if (in(file).disk->step(Fault::kNone) == Fault::kPowerCut) return SQLITE_IOERR_TRUNCATE;
    const FaultDisk::Write write{static_cast<std::size_t>(size), {}, true};
    FaultDisk::apply(in(file).file->now, write);
    in(file).file->volatile_writes.push_back(write);
    return SQLITE_OK;
  }
  static int sync(sqlite3_file* file, int) {
    FaultDisk& disk = *in(file).disk;
    if (disk.on_sync_) disk.on_sync_();
    const Fault fault = disk.step(Fault::kSyncFails);
    if (fault == Fault::kPowerCut) return SQLITE_IOERR_FSYNC;
    auto& writes = in(file).file->volatile_writes;
    if (fault != Fault::kSyncFails) {
      in(file).file->former.reset();
      for (const auto& write : writes) FaultDisk::apply(in(file).file->durable, write);
    }
    writes.clear();
    return fault == Fault::kSyncFails ? SQLITE_IOERR_FSYNC : SQLITE_OK;
  }
  static int size(sqlite3_file* file, sqlite3_int64* bytes) {
    *bytes = static_cast<sqlite3_int64>(in(file).file->now.size());
    return in(file).disk->off_ ? SQLITE_IOERR_FSTAT : SQLITE_OK;
  }
  static int lock(sqlite3_file* file, int level) {
    Inner& mine = in(file);
    const int others = mine.file->sharers - (mine.lock >= SQLITE_LOCK_SHARED ? 1 : 0);
    if (level == SQLITE_LOCK_EXCLUSIVE && others > 0) return SQLITE_BUSY;
    if (mine.lock < SQLITE_LOCK_SHARED) ++mine.file->sharers;
    mine.lock = std::max(mine.lock, level);
    return SQLITE_OK;
  }
  static int unlock(sqlite3_file* file, int level) {
    Inner& mine = in(file);
    if (mine.lock >= SQLITE_LOCK_SHARED && level < SQLITE_LOCK_SHARED) --mine.file->sharers;
    mine.lock = std::min(mine.lock, level);
    return SQLITE_OK;
  }
  static int reserved(sqlite3_file*, int* held) {
    *held = 0;
    return SQLITE_OK;
  }
  static int control(sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; }
  static int sector(sqlite3_file*) { return static_cast<int>(kSector); }
  static int promises(sqlite3_file*) { return SQLITE_IOCAP_POWERSAFE_OVERWRITE; }
  static int shared_map(sqlite3_file* file, int number, int size, int extend, void volatile** out) {
    auto& regions = in(file).file->shared;
    *out = nullptr;
    if (static_cast<std::size_t>(number) >= regions.size() && extend == 0) return SQLITE_OK;
    while (regions.size() <= static_cast<std::size_t>(number))
      regions.push_back(std::make_unique<char[]>(static_cast<std::size_t>(size)));
    *out = regions[static_cast<std::size_t>(number)].get();
    return SQLITE_OK;
  }
  static int shared_lock(sqlite3_file*, int, int, int) { return SQLITE_OK; }
  static void shared_barrier(sqlite3_file*) {}
  static int shared_unmap(sqlite3_file* file, int removed) {
    if (removed != 0) in(file).file->shared.clear();
    return SQLITE_OK;
  }

  static const sqlite3_io_methods* methods() {
    static const sqlite3_io_methods all{
        2,           close,          read,         write,   cut,    sync,     size,
        lock,        unlock,         reserved,     control, sector, promises, shared_map,
        shared_lock, shared_barrier, shared_unmap, nullptr, nullptr};
    return &all;
  }
};

FaultDisk::FaultDisk() : vfs_(std::make_unique<sqlite3_vfs>()), before_(sqlite3_vfs_find(nullptr)) {
  vfs_->iVersion = 2;
  vfs_->szOsFile = sizeof(DiskCalls::Handle);
  vfs_->mxPathname = 512;
  vfs_->zName = "fault_disk";
  vfs_->pAppData = this;
  vfs_->xOpen = DiskCalls::open;
  vfs_->xDelete = DiskCalls::remove;
  vfs_->xAccess = DiskCalls::access;
  vfs_->xFullPathname = DiskCalls::full_name;
  vfs_->xRandomness = DiskCalls::randomness;
  vfs_->xSleep = DiskCalls::sleep;
  vfs_->xGetLastError = DiskCalls::last_error;
  vfs_->xCurrentTimeInt64 = DiskCalls::time;
  sqlite3_vfs_register(vfs_.get(), 1);
}

FaultDisk::~FaultDisk() {
  sqlite3_vfs_unregister(vfs_.get());
  sqlite3_vfs_register(before_, 1);
}

std::shared_ptr<FaultDisk::File> FaultDisk::find(const std::string& path) const {
  const auto found = files_.find(path);
  return found == files_.end() || found->second->deleted ? nullptr : found->second;
}

FaultDisk::Fault FaultDisk::step(Fault possible) {
  if (off_) return Fault::kPowerCut;
  if (steps_++ != fault_at_ || fault_ == Fault::kReadFails) return Fault::kNone;
  if (fault_ == Fault::kPowerCut) return off_ = failed_ = true, fault_;
  if (fault_ == Fault::kFull) full_ = true;  // failed when something does not fit
  if (fault_ != possible) return Fault::kNone;
  failed_ = true;
  return fault_;
}

bool FaultDisk::read_fails() {
  if (reads_++ == fault_at_ && fault_ == Fault::kReadFails) unreadable_ = failed_ = true;
  return off_ || unreadable_;
}

void FaultDisk::fail_at(std::uint64_t step, Fault fault) {
  fault_ = fault;
  fault_at_ = (fault == Fault::kReadFails ? reads_ : steps_) + step;
  failed_ = false;
}

void FaultDisk::recover() {
  full_ = unreadable_ = false;
  fault_ = Fault::kNone;
}

void FaultDisk::apply(std::string& bytes, const Write& write) {
  if (write.cuts) return bytes.resize(std::min(bytes.size(), write.at));
  if (bytes.size() < write.at + write.bytes.size()) bytes.resize(write.at + write.bytes.size());
  std::copy(write.bytes.begin(), write.bytes.end(),
            bytes.begin() + static_cast<std::ptrdiff_t>(write.at));
}

/// @param keep  decides for each sector
void FaultDisk::apply_torn(std::string& bytes, const Write& write,
                           const std::function<bool()>& keep) {
  for (std::size_t from = 0; from < write.bytes.size();) {
    const std::size_t length = std::min(
        write.bytes.size() - from, DiskCalls::kSector - (write.at + from) % DiskCalls::kSector);
    if (keep()) apply(bytes, {write.at + from, write.bytes.substr(from, length), false});
    from += length;
  }
}

void FaultDisk::reboot(std::uint32_t seed) {
  enum Fate { kLost, kKept, kTorn };
  std::mt19937 random(seed);
  const auto fate = [&] { return seed < kTorn ? Fate(seed) : Fate(random() % 3); };
  if (off_ || at_cut_.empty()) at_cut_ = std::exchange(files_, {});
  files_.clear();
  for (auto [path, file] : at_cut_) {
    if (file->former && fate() == kLost) file = file->former;
    std::string bytes = file->durable;
    for (const Write& write : file->volatile_writes) {
      const Fate of_this = fate();
      if (of_this == kKept) apply(bytes, write);
      if (of_this == kTorn && !write.cuts)
        apply_torn(bytes, write, [&] { return random() % 2 == 0; });
    }
    auto after = std::make_shared<File>();
    after->deleted = file->deleted && (file->durable.empty() || fate() != kLost);
    if (!after->deleted) after->now = after->durable = bytes;
    files_[path] = after;
  }
  off_ = false;
  recover();
}

std::string FaultDisk::content(const std::string& path) const {
  const auto file = find(path);
  return file ? file->now : std::string{};
}

void FaultDisk::set_content(const std::string& path, const std::string& bytes) {
  auto file = std::make_shared<File>();
  file->now = file->durable = bytes;
  files_[path] = file;
}

}  // namespace fiducap::test
