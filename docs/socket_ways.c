/* What a frame costs by each of the kernel's ways to send and to receive it, in a network namespace of its own:
 *
 *     cc -O2 docs/socket_ways.c -o socket_ways && sudo ./socket_ways
 *
 * Each millisecond 192 frames of 64 octets go over a veth pair. A table says what sender and receiver took of a CPU.
 * The sender pays for the delivery at the other end as well.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <linux/if_packet.h>
#include <linux/if_xdp.h>
#include <linux/io_uring.h>
#include <net/if.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { FRAMES = 192, SIZE = 64, SECONDS = 3, PLACES = 512, CHUNK = 4096, SLOTS = 1024, SLOT = 256 };

static unsigned char frames[FRAMES][SIZE];
static unsigned char heard[FRAMES][SLOT];
static struct mmsghdr messages[FRAMES];
static struct iovec vectors[FRAMES];
static struct sockaddr_ll address;
static volatile unsigned char seen;

static void die(const char *what) {
    perror(what);
    exit(1);
}

static void *map(int fd, size_t size, unsigned long long place) {
    void *found = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd, (off_t)place);
    if (found == MAP_FAILED) die("mmap");
    return found;
}

static int packet_socket(int interface, int protocol) {
    int made = socket(AF_PACKET, SOCK_RAW, 0), room = 1 << 23;
    if (made < 0) die("packet socket");
    setsockopt(made, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room);
    setsockopt(made, SOL_SOCKET, SO_SNDBUFFORCE, &room, sizeof room);
    address = (struct sockaddr_ll){.sll_family = AF_PACKET, .sll_ifindex = interface, .sll_halen = 6};
    address.sll_protocol = htons(protocol);
    return made;
}

/* -- io_uring ---------------------------------------------------------------------------------------------------- */

static struct {
    int fd;
    unsigned *tail, *array, *head, *end, mask, completion_mask;
    struct io_uring_sqe *entries;
    struct io_uring_cqe *completions;
} uring;

static void open_uring(int registered) {
    struct io_uring_params given = {.flags = IORING_SETUP_SINGLE_ISSUER | IORING_SETUP_DEFER_TASKRUN};
    uring.fd = (int)syscall(__NR_io_uring_setup, 256, &given);
    if (uring.fd < 0) die("io_uring_setup");
    char *sq = map(uring.fd, given.sq_off.array + given.sq_entries * sizeof(unsigned), IORING_OFF_SQ_RING);
    char *cq = map(uring.fd, given.cq_off.cqes + given.cq_entries * sizeof(struct io_uring_cqe), IORING_OFF_CQ_RING);
    uring.entries = map(uring.fd, given.sq_entries * sizeof(struct io_uring_sqe), IORING_OFF_SQES);
    uring.tail = (unsigned *)(sq + given.sq_off.tail);
    uring.array = (unsigned *)(sq + given.sq_off.array);
    uring.mask = *(unsigned *)(sq + given.sq_off.ring_mask);
    uring.head = (unsigned *)(cq + given.cq_off.head);
    uring.end = (unsigned *)(cq + given.cq_off.tail);
    uring.completion_mask = *(unsigned *)(cq + given.cq_off.ring_mask);
    uring.completions = (struct io_uring_cqe *)(cq + given.cq_off.cqes);
    if (syscall(__NR_io_uring_register, uring.fd, IORING_REGISTER_FILES, &registered, 1)) die("io_uring_register");
}

/* One call for all frames of the registered socket; returns how many succeeded. */
static int by_uring(int opcode) {
    unsigned tail = *uring.tail;
    for (int i = 0; i < FRAMES; i++) {
        struct io_uring_sqe *entry = &uring.entries[(tail + i) & uring.mask];
        memset(entry, 0, sizeof *entry);
        entry->opcode = opcode;
        entry->flags = IOSQE_FIXED_FILE;
        entry->addr = opcode == IORING_OP_SENDMSG ? (unsigned long)&messages[i].msg_hdr : (unsigned long)heard[i];
        entry->len = opcode == IORING_OP_SENDMSG ? 1 : SLOT;
        entry->msg_flags = MSG_DONTWAIT;
        uring.array[(tail + i) & uring.mask] = (tail + i) & uring.mask;
    }
    __atomic_store_n(uring.tail, tail + FRAMES, __ATOMIC_RELEASE);
    if (syscall(__NR_io_uring_enter, uring.fd, FRAMES, FRAMES, IORING_ENTER_GETEVENTS, NULL, 0) < 0) die("enter");
    unsigned head = *uring.head, end = __atomic_load_n(uring.end, __ATOMIC_ACQUIRE);
    int good = 0;
    for (; head != end; head++) good += uring.completions[head & uring.completion_mask].res > 0;
    __atomic_store_n(uring.head, head, __ATOMIC_RELEASE);
    return good;
}

/* -- AF_XDP, copy mode ------------------------------------------------------------------------------------------- */

static struct {
    int fd;
    unsigned char *memory;
    struct xdp_desc *descriptors;
    unsigned *given, *taken, *left, *reaped;
} express;

static void open_express(int interface) {
    int places = PLACES;
    express.fd = socket(AF_XDP, SOCK_RAW, 0);
    if (express.fd < 0) die("AF_XDP");
    express.memory = mmap(NULL, PLACES * CHUNK, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    struct xdp_umem_reg umem = {.addr = (unsigned long)express.memory, .len = PLACES * CHUNK, .chunk_size = CHUNK};
    if (setsockopt(express.fd, SOL_XDP, XDP_UMEM_REG, &umem, sizeof umem)) die("umem");
    setsockopt(express.fd, SOL_XDP, XDP_UMEM_FILL_RING, &places, sizeof places);
    setsockopt(express.fd, SOL_XDP, XDP_UMEM_COMPLETION_RING, &places, sizeof places);
    if (setsockopt(express.fd, SOL_XDP, XDP_TX_RING, &places, sizeof places)) die("tx ring");
    struct xdp_mmap_offsets at;
    socklen_t size = sizeof at;
    if (getsockopt(express.fd, SOL_XDP, XDP_MMAP_OFFSETS, &at, &size)) die("offsets");
    char *tx = map(express.fd, at.tx.desc + PLACES * sizeof(struct xdp_desc), XDP_PGOFF_TX_RING);
    char *done = map(express.fd, at.cr.desc + PLACES * 8, XDP_UMEM_PGOFF_COMPLETION_RING);
    express.descriptors = (struct xdp_desc *)(tx + at.tx.desc);
    express.given = (unsigned *)(tx + at.tx.producer);
    express.taken = (unsigned *)(tx + at.tx.consumer);
    express.left = (unsigned *)(done + at.cr.producer);
    express.reaped = (unsigned *)(done + at.cr.consumer);
    struct sockaddr_xdp where = {.sxdp_family = AF_XDP, .sxdp_ifindex = interface, .sxdp_flags = XDP_COPY};
    if (bind(express.fd, (struct sockaddr *)&where, sizeof where)) die("bind AF_XDP");
}

static int by_express(void) {
    unsigned given = *express.given;
    for (int i = 0; i < FRAMES; i++) {
        unsigned place = (given + i) & (PLACES - 1);
        memcpy(express.memory + place * CHUNK, frames[i], SIZE);
        express.descriptors[place] = (struct xdp_desc){.addr = place * CHUNK, .len = SIZE};
    }
    __atomic_store_n(express.given, given + FRAMES, __ATOMIC_RELEASE);
    while (__atomic_load_n(express.taken, __ATOMIC_ACQUIRE) != given + FRAMES) {
        if (sendto(express.fd, NULL, 0, MSG_DONTWAIT, NULL, 0) < 0 && errno != EAGAIN && errno != EBUSY) die("sendto");
        __atomic_store_n(express.reaped, __atomic_load_n(express.left, __ATOMIC_ACQUIRE), __ATOMIC_RELEASE);
    }
    return FRAMES;
}

/* -- both ends --------------------------------------------------------------------------------------------------- */

static long long now(void) {
    struct timespec found;
    clock_gettime(CLOCK_MONOTONIC, &found);
    return found.tv_sec * 1000000000LL + found.tv_nsec;
}

static long long until_next(long long due) {
    struct timespec when = {(due + 1000000) / 1000000000, (due + 1000000) % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &when, NULL);
    return due + 1000000;
}

static double us_of_cpu(void) {
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    return (used.ru_utime.tv_sec + used.ru_stime.tv_sec) * 1e6 + used.ru_utime.tv_usec + used.ru_stime.tv_usec;
}

static void send_by(const char *way) {
    int interface = if_nametoindex("near"), packets = packet_socket(interface, 0x8892), yes = 1;
    long sent = 0;
    for (int i = 0; i < FRAMES; i++) {
        memcpy(frames[i], "\x02\0\0\0\0\x02\x02\0\0\0\0\x01\x88\x92\x80\x01", 16);
        vectors[i] = (struct iovec){frames[i], SIZE};
        messages[i].msg_hdr = (struct msghdr){&address, sizeof address, &vectors[i], 1, NULL, 0, 0};
    }
    if (!strcmp(way, "bypass") && setsockopt(packets, SOL_PACKET, PACKET_QDISC_BYPASS, &yes, sizeof yes)) die(way);
    if (!strcmp(way, "io_uring")) open_uring(packets);
    if (!strcmp(way, "AF_XDP")) open_express(interface);
    double before = us_of_cpu();
    for (long long due = now(), end = due + SECONDS * 1000000000LL; due < end; due = until_next(due)) {
        for (int i = 0; i < FRAMES; i++) frames[i][20]++;
        if (!strcmp(way, "io_uring")) sent += by_uring(IORING_OP_SENDMSG);
        else if (!strcmp(way, "AF_XDP")) sent += by_express();
        else sent += sendmmsg(packets, messages, FRAMES, 0);
    }
    printf("sent by %-10s %6.3f us a frame", way, (us_of_cpu() - before) / (double)sent);
}

static int from_ring(char *ring, unsigned *at) {
    int got = 0;
    for (;; got++, ++*at) {
        struct tpacket2_hdr *slot = (struct tpacket2_hdr *)(ring + (*at % SLOTS) * SLOT);
        if (!(__atomic_load_n(&slot->tp_status, __ATOMIC_ACQUIRE) & TP_STATUS_USER)) return got;
        seen ^= ((unsigned char *)slot)[slot->tp_mac + 20];
        __atomic_store_n(&slot->tp_status, TP_STATUS_KERNEL, __ATOMIC_RELEASE);
    }
}

static void receive_by(const char *way) {
    int packets = packet_socket(if_nametoindex("far"), 0x8892), version = TPACKET_V2;
    unsigned at = 0;
    long got = 0;
    char *ring = NULL;
    for (int i = 0; i < FRAMES; i++) {
        vectors[i] = (struct iovec){heard[i], SLOT};
        messages[i].msg_hdr = (struct msghdr){NULL, 0, &vectors[i], 1, NULL, 0, 0};
    }
    if (!strcmp(way, "TPACKET_V2")) {
        struct tpacket_req asked = {4096, SLOTS * SLOT / 4096, SLOT, SLOTS};
        setsockopt(packets, SOL_PACKET, PACKET_VERSION, &version, sizeof version);
        if (setsockopt(packets, SOL_PACKET, PACKET_RX_RING, &asked, sizeof asked)) die(way);
        ring = map(packets, SLOTS * SLOT, 0);
    }
    if (bind(packets, (struct sockaddr *)&address, sizeof address)) die("bind");
    if (!strcmp(way, "io_uring")) open_uring(packets);
    double before = us_of_cpu();
    for (long long due = now(), end = due + (SECONDS + 1) * 1000000000LL; due < end; due = until_next(due)) {
        int count;
        if (ring) count = from_ring(ring, &at);
        else if (!strcmp(way, "io_uring")) count = by_uring(IORING_OP_RECV);
        else count = recvmmsg(packets, messages, FRAMES, MSG_DONTWAIT, NULL);
        got += count > 0 ? count : 0;
    }
    printf("; received by %-10s %6.3f us a frame, %ld frames\n", way, (us_of_cpu() - before) / (double)got, got);
}

int main(void) {
    const char *sending[] = {"sendmmsg", "bypass", "io_uring", "AF_XDP", "sendmmsg", "sendmmsg"};
    const char *receiving[] = {"recvmmsg", "recvmmsg", "recvmmsg", "recvmmsg", "TPACKET_V2", "io_uring"};
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(sysconf(_SC_NPROCESSORS_ONLN) - 1, &one);
    if (unshare(CLONE_NEWNET)) die("unshare");
    if (system("ip link add near type veth peer name far && ip link set near up && ip link set far up")) return 1;
    sched_setaffinity(0, sizeof one, &one);
    setvbuf(stdout, NULL, _IONBF, 0);
    for (unsigned i = 0; i < sizeof sending / sizeof *sending; i++) {
        pid_t listener = fork();
        if (!listener) {
            receive_by(receiving[i]);
            return 0;
        }
        usleep(300000);
        pid_t sender = fork();
        if (!sender) {
            send_by(sending[i]);
            return 0;
        }
        waitpid(sender, NULL, 0);
        waitpid(listener, NULL, 0);
    }
    return 0;
}
