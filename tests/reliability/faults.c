/* Disks that fail and power that goes, for a program that does not know of it. To be loaded with LD_PRELOAD.
 *
 * It intercepts the calls that change regular files and directories below the folder FAULTS_FOLDER (an absolute path,
 * as the program spells it), and those that read a part of such a file, which are counted apart. Everything else passes
 * untouched: sockets, pipes, other files.
 *
 * FAULTS_CONTROL names a file of the size of `struct control`, through which a test counts these calls, and has some of
 * them fail, while the program runs. FAULTS_UNDO, if it is set, names a file to which everything is written that would
 * undo what was not yet synced (see `struct record`): faults.py reads it after a SIGKILL, and takes back what a disk
 * without power could have lost. It is written before the change itself, by the kernel at once, and so is complete
 * whenever the program is killed.
 *
 * The calls are made with syscall(), since the names of libc are the ones that are intercepted here.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

/* Shared with the test: faults.py has the same fields. */
struct control {
    _Atomic int64_t calls;    /* so many calls were intercepted */
    _Atomic int64_t fail_at;  /* the first of them that fails, counted from 1; 0: none */
    _Atomic int64_t count;    /* so many fail, from that one on */
    _Atomic int64_t error;    /* with this errno, or as below */
    _Atomic int64_t failed;   /* so many have failed */
    _Atomic int64_t lying;    /* syncs succeed, but keep nothing: shows that a test would find a loss */
    _Atomic int64_t reads;    /* so many calls have read */
    _Atomic int64_t fail_read_at; /* the one of them that fails, with EIO; 0: none */
};
enum { HALF = -1, DIE = -2 }; /* half of the bytes are written; the process is killed before the call */

/* What undoes a change; `kept` bytes follow. Numbers are in the byte order of the machine. */
struct record {
    int64_t kind, number;  /* one of the kinds below; records count from 1, those of one change have one number */
    int64_t file;          /* inode; 0 for changes of a directory */
    int64_t offset, size;  /* of the bytes written */
    int64_t length;        /* of the file before */
    int64_t kept;          /* WRITE, CUT: the old bytes from `offset` on; CREATED, REMOVED: the path */
};
enum { WRITE = 1, CUT, SYNCED, CREATED, REMOVED };

static struct control *control;
static const char *folder;
static char kept_folder[PATH_MAX]; /* removed files, under the numbers of their records */
static int undo = -1;

/* Held while a change is recorded and made, so that both have the same order. */
static pthread_mutex_t changing = PTHREAD_MUTEX_INITIALIZER;
static int64_t number;
/* Files with unsynced changes, and the last of them: when there are none, the records are of no more use. */
enum { MOST_FILES = 64 };
static struct { int64_t file, last; } unsynced[MOST_FILES];
static int unsynced_files;

__attribute__((noreturn)) static void give_up(const char *what) {
    dprintf(2, "faults.c: %s: %s\n", what, strerror(errno));
    abort();
}

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("FAULTS_CONTROL"), *undo_path = getenv("FAULTS_UNDO");
    folder = getenv("FAULTS_FOLDER");
    if (!path || !folder) return;
    int fd = syscall(SYS_openat, AT_FDCWD, path, O_RDWR | O_CLOEXEC);
    struct control *mapped = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (mapped == MAP_FAILED) give_up(path);
    close(fd);
    if (undo_path) {
        undo = syscall(SYS_openat, AT_FDCWD, undo_path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
        if (undo < 0) give_up(undo_path);
        snprintf(kept_folder, sizeof kept_folder, "%s.kept", undo_path);
        mkdir(kept_folder, 0700);
    }
    control = mapped;
}

static int is_below(const char *path) {
    size_t length = strlen(folder);
    return strncmp(path, folder, length) == 0 && (path[length] == '/' || path[length] == 0);
}

/* Whether this is an open file, or directory, below the folder. */
static int is_ours(int fd, struct stat *found) {
    char link[64], path[PATH_MAX];
    if (!control || fstat(fd, found) != 0 || !(S_ISREG(found->st_mode) || S_ISDIR(found->st_mode))) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    if (!is_below(path)) return 0;
    /* a file that nobody can open again has nothing to lose; nor has the index of SQLite's log, which it builds anew */
    if (found->st_nlink == 0 || (length > 4 && strcmp(path + length - 4, "-shm") == 0)) found->st_ino = 0;
    return 1;
}

/* Counts a call: 0, or how it is to fail. */
static int fault(void) {
    int64_t call = atomic_fetch_add(&control->calls, 1) + 1, first = control->fail_at;
    if (first == 0 || call < first || call - first >= control->count) return 0;
    atomic_fetch_add(&control->failed, 1);
    if (control->error == DIE) {
        kill(getpid(), SIGKILL);
        pause();
    }
    return (int)control->error;
}

/* Whether a call fails; sets errno. */
static int fails(void) {
    int error = fault();
    if (error > 0) errno = error;
    return error > 0;
}

/* ---- what would undo it: all of these with `changing` held ---- */

static void add_record(int kind, int64_t file, int64_t offset, int64_t size, int64_t length, const void *kept, size_t bytes) {
    struct record record = {kind, number, file, offset, size, length, (int64_t)bytes};
    struct iovec parts[2] = {{&record, sizeof record}, {(void *)kept, bytes}};
    if (syscall(SYS_writev, undo, parts, 2) != (long)(sizeof record + bytes)) give_up("the records of undo");
}

static void mark(int64_t file) {
    int i = 0;
    while (i < unsynced_files && unsynced[i].file != file) i++;
    if (i == MOST_FILES) give_up("too many files with unsynced changes");
    if (i == unsynced_files) unsynced_files++;
    unsynced[i].file = file;
    unsynced[i].last = number;
}

/* The old bytes of a part of a file that is written or cut off. */
static void keep(int kind, int fd, const struct stat *found, int64_t offset, int64_t size) {
    if (undo < 0 || found->st_ino == 0) return;
    int64_t end = offset + size < found->st_size ? offset + size : found->st_size;
    size_t bytes = end > offset ? (size_t)(end - offset) : 0;
    char *old = malloc(bytes + 1);
    int reading = fd;
    if ((fcntl(fd, F_GETFL) & O_ACCMODE) == O_WRONLY) {
        char link[64];
        snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
        reading = syscall(SYS_openat, AT_FDCWD, link, O_RDONLY | O_CLOEXEC);
    }
    if (!old || (bytes && syscall(SYS_pread64, reading, old, bytes, offset) != (ssize_t)bytes)) give_up("the old bytes of a file");
    if (reading != fd) close(reading);
    number++;
    add_record(kind, found->st_ino, offset, size, found->st_size, old, bytes);
    mark(found->st_ino);
    free(old);
}

static void keep_name(int kind, const char *path) {
    if (undo < 0) return;
    char kept[PATH_MAX + NAME_MAX + 32];
    snprintf(kept, sizeof kept, "%s/%lld-%s", kept_folder, (long long)number, strrchr(path, '/') + 1);
    if (kind == REMOVED && linkat(AT_FDCWD, path, AT_FDCWD, kept, 0) != 0) return; /* there is nothing to remove */
    add_record(kind, 0, 0, 0, 0, path, strlen(path));
    mark(0);
}

/* What was changed before number `until` is on the disk. */
static void synced(int64_t file, int64_t until) {
    int64_t now = number;
    number = until;
    add_record(SYNCED, file, 0, 0, 0, NULL, 0);
    number = now;
    for (int i = 0; i < unsynced_files; i++)
        if (unsynced[i].file == file && unsynced[i].last <= until) unsynced[i] = unsynced[--unsynced_files];
    if (unsynced_files == 0 && ftruncate64(undo, 0) != 0) give_up("the records of undo");
}

/* ---- the intercepted calls ---- */

static int64_t place(int fd, const struct stat *found) {
    return fcntl(fd, F_GETFL) & O_APPEND ? found->st_size : lseek(fd, 0, SEEK_CUR);
}

/* Bytes to `offset`, or where the file stands if that is negative. */
static ssize_t write_bytes(int fd, const void *bytes, size_t size, off64_t offset) {
    struct stat found;
    if (is_ours(fd, &found)) {
        int error = fault();
        if (error > 0) {
            errno = error;
            return -1;
        }
        if (error == HALF && size > 1) size /= 2;
        pthread_mutex_lock(&changing);
        struct stat now; /* the length may have changed since */
        fstat(fd, &now);
        now.st_ino = found.st_ino;
        keep(WRITE, fd, &now, offset < 0 ? place(fd, &now) : offset, (int64_t)size);
        ssize_t written = offset < 0 ? syscall(SYS_write, fd, bytes, size) : syscall(SYS_pwrite64, fd, bytes, size, offset);
        pthread_mutex_unlock(&changing);
        return written;
    }
    return offset < 0 ? syscall(SYS_write, fd, bytes, size) : syscall(SYS_pwrite64, fd, bytes, size, offset);
}

static ssize_t read_bytes(int fd, void *bytes, size_t size, off64_t offset) {
    struct stat found;
    if (control && control->fail_read_at && is_ours(fd, &found) &&
        atomic_fetch_add(&control->reads, 1) + 1 == control->fail_read_at) {
        atomic_fetch_add(&control->failed, 1);
        errno = EIO;
        return -1;
    }
    return syscall(SYS_pread64, fd, bytes, size, offset);
}

/* Several pieces. On our files the first that is not empty: fewer bytes than asked for are allowed, and rare. */
static ssize_t write_pieces(int fd, const struct iovec *pieces, int count, off64_t offset) {
    struct stat found;
    if (is_ours(fd, &found)) {
        while (count > 1 && pieces->iov_len == 0) pieces++, count--;
        return count > 0 ? write_bytes(fd, pieces->iov_base, pieces->iov_len, offset) : 0;
    }
    if (offset < 0) return syscall(SYS_writev, fd, pieces, count);
    return syscall(SYS_pwritev, fd, pieces, count, (long)offset, 0L);
}

static int sync_file(int fd, long call) {
    struct stat found;
    if (!is_ours(fd, &found)) return syscall(call, fd);
    if (fails()) return -1;
    if (control->lying) return 0;
    pthread_mutex_lock(&changing);
    int64_t until = number; /* what is written meanwhile may be too late */
    pthread_mutex_unlock(&changing);
    int result = syscall(call, fd);
    if (result == 0 && undo >= 0 && found.st_ino != 0) {
        pthread_mutex_lock(&changing);
        synced(S_ISDIR(found.st_mode) ? 0 : (int64_t)found.st_ino, until);
        pthread_mutex_unlock(&changing);
    }
    return result;
}

static int set_length(int fd, off64_t length) {
    struct stat found;
    if (!is_ours(fd, &found)) return syscall(SYS_ftruncate, fd, length);
    if (fails()) return -1;
    pthread_mutex_lock(&changing);
    struct stat now;
    fstat(fd, &now);
    now.st_ino = found.st_ino;
    keep(CUT, fd, &now, length, now.st_size > length ? now.st_size - length : 0);
    int result = syscall(SYS_ftruncate, fd, length);
    pthread_mutex_unlock(&changing);
    return result;
}

static int remove_file(int at, const char *path, int flags) {
    if (!control || !is_below(path) || flags & AT_REMOVEDIR) return syscall(SYS_unlinkat, at, path, flags);
    if (fails()) return -1;
    pthread_mutex_lock(&changing);
    number++;
    keep_name(REMOVED, path);
    int result = syscall(SYS_unlinkat, at, path, flags);
    pthread_mutex_unlock(&changing);
    return result;
}

static int rename_file(int from_at, const char *from, int to_at, const char *to) {
    if (!control || !is_below(from) || !is_below(to)) return syscall(SYS_renameat2, from_at, from, to_at, to, 0);
    if (fails()) return -1;
    pthread_mutex_lock(&changing);
    number++;
    keep_name(REMOVED, from);
    keep_name(access(to, F_OK) == 0 ? REMOVED : CREATED, to);
    int result = syscall(SYS_renameat2, from_at, from, to_at, to, 0);
    pthread_mutex_unlock(&changing);
    return result;
}

/* Opening only to read never fails here, and to open what is there a full disk does not matter. A file without a name (O_TMPFILE) counts, though there is nothing to undo. */
static int open_file(int at, const char *path, int flags, mode_t mode) {
    int writes = flags & (O_CREAT | O_WRONLY | O_RDWR | O_TRUNC);
    if (!control || !is_below(path) || !writes) return syscall(SYS_openat, at, path, flags | O_LARGEFILE, mode);
    int creates = flags & O_CREAT && access(path, F_OK) != 0, full = control->error == ENOSPC || control->error == EDQUOT;
    if ((creates || !full) && fails()) return -1;
    pthread_mutex_lock(&changing);
    size_t length = strlen(path);
    int is_index = length > 4 && strcmp(path + length - 4, "-shm") == 0;
    if (creates && !is_index) {
        number++;
        keep_name(CREATED, path);
    }
    int fd = syscall(SYS_openat, at, path, (flags & ~O_TRUNC) | O_LARGEFILE, mode);
    struct stat found;
    if (fd >= 0 && flags & O_TRUNC && is_ours(fd, &found)) {
        keep(CUT, fd, &found, 0, found.st_size);
        syscall(SYS_ftruncate, fd, 0L);
    }
    pthread_mutex_unlock(&changing);
    return fd;
}

ssize_t write(int fd, const void *bytes, size_t size) { return write_bytes(fd, bytes, size, -1); }
ssize_t pwrite(int fd, const void *bytes, size_t size, off_t at) { return write_bytes(fd, bytes, size, at); }
ssize_t pwrite64(int fd, const void *bytes, size_t size, off64_t at) { return write_bytes(fd, bytes, size, at); }
ssize_t pread(int fd, void *bytes, size_t size, off_t at) { return read_bytes(fd, bytes, size, at); }
ssize_t pread64(int fd, void *bytes, size_t size, off64_t at) { return read_bytes(fd, bytes, size, at); }
ssize_t writev(int fd, const struct iovec *pieces, int count) { return write_pieces(fd, pieces, count, -1); }
ssize_t pwritev(int fd, const struct iovec *pieces, int count, off_t at) { return write_pieces(fd, pieces, count, at); }
ssize_t pwritev64(int fd, const struct iovec *pieces, int count, off64_t at) { return write_pieces(fd, pieces, count, at); }
int fsync(int fd) { return sync_file(fd, SYS_fsync); }
int fdatasync(int fd) { return sync_file(fd, SYS_fdatasync); }
int ftruncate(int fd, off_t length) { return set_length(fd, length); }
int ftruncate64(int fd, off64_t length) { return set_length(fd, length); }
int unlink(const char *path) { return remove_file(AT_FDCWD, path, 0); }
int unlinkat(int at, const char *path, int flags) { return remove_file(at, path, flags); }
int rename(const char *from, const char *to) { return rename_file(AT_FDCWD, from, AT_FDCWD, to); }
int renameat(int from_at, const char *from, int to_at, const char *to) { return rename_file(from_at, from, to_at, to); }

/* The mode is there only if something may be created. */
#define OPEN(at) \
    va_list rest; \
    va_start(rest, flags); \
    mode_t mode = flags & (O_CREAT | __O_TMPFILE) ? va_arg(rest, mode_t) : 0; \
    va_end(rest); \
    return open_file(at, path, flags, mode);

int open(const char *path, int flags, ...) { OPEN(AT_FDCWD) }
int open64(const char *path, int flags, ...) { OPEN(AT_FDCWD) }
int openat(int at, const char *path, int flags, ...) { OPEN(at) }
int openat64(int at, const char *path, int flags, ...) { OPEN(at) }
