// A test by ear whether two sounds can be told apart: X is one of A and B, chosen anew in each trial.

// The part of guessers that are right at least so often: the upper tail of Binomial(trials, 1/2).
export function guessing(right, trials) {
    let [tail, term] = [0, 0.5 ** trials];
    for (let k = 0; k <= trials; k++) {
        if (k >= right) tail += term;
        term *= (trials - k) / (k + 1);
    }
    return Math.min(1, tail);
}

export class Abx {
    // `toss` returns true or false, each as often.
    constructor(trials, toss = () => crypto.getRandomValues(new Uint8Array(1))[0] < 128) {
        this.trials = trials;
        this.toss = toss;
        this.answers = []; // true where it was right
        this.x = toss() ? 0 : 1;
    }

    get isOver() {
        return this.answers.length >= this.trials;
    }

    get right() {
        return this.answers.filter(Boolean).length;
    }

    answer(number) {
        if (this.isOver) return;
        this.answers.push(number === this.x);
        this.x = this.toss() ? 0 : 1;
    }

    get result() {
        const chance = 100 * guessing(this.right, this.trials);
        const often = chance < 1 ? "in less than 1 %" : `in ${Math.round(chance)} %`;
        return `${this.right} of ${this.trials} right. Who guesses is right so often, or more often, ${often} of such tests.`;
    }
}
