//! Blobs: joined pixels of one paint.

/// Joined pixels with the same label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blob {
    /// Their label.
    pub label: u8,
    /// How many pixels.
    pub area: usize,
    /// Leftmost column.
    pub left: usize,
    /// Uppermost row.
    pub top: usize,
    /// Rightmost column, itself included.
    pub right: usize,
    /// Lowest row, itself included.
    pub bottom: usize,
    column_sum: f64,
    row_sum: f64,
}

impl Blob {
    /// Centre of mass: column and row, pixel centres at halves.
    pub fn centre(&self) -> (f64, f64) {
        let area = self.area as f64;
        (self.column_sum / area + 0.5, self.row_sum / area + 0.5)
    }

    /// Columns from left to right.
    pub fn width(&self) -> usize {
        self.right - self.left + 1
    }

    /// Rows from top to bottom.
    pub fn height(&self) -> usize {
        self.bottom - self.top + 1
    }

    fn of_run(run: &Run, row: usize) -> Self {
        let area = run.end - run.start;
        Self {
            label: run.label,
            area,
            left: run.start,
            top: row,
            right: run.end - 1,
            bottom: row,
            column_sum: (run.start + run.end - 1) as f64 / 2.0 * area as f64,
            row_sum: (row * area) as f64,
        }
    }

    fn join(&mut self, other: &Self) {
        self.area += other.area;
        self.left = self.left.min(other.left);
        self.top = self.top.min(other.top);
        self.right = self.right.max(other.right);
        self.bottom = self.bottom.max(other.bottom);
        self.column_sum += other.column_sum;
        self.row_sum += other.row_sum;
    }
}

/// Neighbouring pixels of one row with one label.
#[derive(Debug, Clone, Copy)]
struct Run {
    label: u8,
    start: usize,
    end: usize,
    /// Index into the blobs.
    blob: usize,
}

/// All blobs of a picture of labels (0 is none), in the order of their first pixels; pixels
/// join at edges and corners.
pub fn blobs(labels: &[u8], width: usize) -> Vec<Blob> {
    let mut forest = Forest::default();
    let mut above: Vec<Run> = Vec::new();
    for (row, pixels) in labels.chunks_exact(width.max(1)).enumerate() {
        let mut runs = runs_of(pixels);
        for run in &mut runs {
            run.blob = forest.plant(Blob::of_run(run, row));
            let touching = above.iter().filter(|up| up.start <= run.end && run.start <= up.end);
            for up in touching.filter(|up| up.label == run.label) {
                run.blob = forest.join(up.blob, run.blob);
            }
        }
        above = runs;
    }
    forest.roots()
}

fn runs_of(pixels: &[u8]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (column, &label) in pixels.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if run.label == label && run.end == column => run.end += 1,
            Some(_) | None if label != 0 => {
                runs.push(Run { label, start: column, end: column + 1, blob: 0 });
            }
            Some(_) | None => {}
        }
    }
    runs
}

/// Blobs that turn out to be one point to the eldest.
#[derive(Debug, Default)]
struct Forest {
    blobs: Vec<Blob>,
    parents: Vec<usize>,
}

impl Forest {
    fn plant(&mut self, blob: Blob) -> usize {
        self.blobs.push(blob);
        self.parents.push(self.parents.len());
        self.parents.len() - 1
    }

    fn root(&mut self, mut index: usize) -> usize {
        while self.parents[index] != index {
            // Halving the way keeps trees flat.
            self.parents[index] = self.parents[self.parents[index]];
            index = self.parents[index];
        }
        index
    }

    fn join(&mut self, one: usize, two: usize) -> usize {
        let (one, two) = (self.root(one), self.root(two));
        let (elder, younger) = (one.min(two), one.max(two));
        if elder != younger {
            self.parents[younger] = elder;
            let joined = self.blobs[younger];
            self.blobs[elder].join(&joined);
        }
        elder
    }

    fn roots(self) -> Vec<Blob> {
        let parents = self.parents.iter().enumerate();
        parents.filter(|(index, parent)| index == *parent).map(|(i, _)| self.blobs[i]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(rows: &[&str]) -> Vec<u8> {
        let label = |c: char| u8::try_from(c.to_digit(10).unwrap_or(0)).unwrap();
        rows.iter().flat_map(|row| row.chars().map(label)).collect()
    }

    #[test]
    fn a_u_is_one_blob_and_labels_do_not_mix() {
        let picture = labels(&["1...1.", "1.2.1.", "11111.", ".....1"]);

        let blobs = blobs(&picture, 6);

        assert_eq!(blobs.len(), 2);
        assert_eq!((blobs[0].label, blobs[0].area), (1, 10));
        assert_eq!((blobs[0].left, blobs[0].top, blobs[0].right, blobs[0].bottom), (0, 0, 5, 3));
        assert_eq!((blobs[1].label, blobs[1].area, blobs[1].centre()), (2, 1, (2.5, 1.5)));
    }

    #[test]
    fn the_centre_of_a_rectangle_is_its_middle() {
        let picture = labels(&["......", ".3333.", ".3333.", ".3333."]);

        let blob = blobs(&picture, 6)[0];

        assert_eq!(blob.centre(), (3.0, 2.5));
        assert_eq!((blob.width(), blob.height(), blob.area), (4, 3, 12));
    }

    #[test]
    fn an_empty_or_full_picture_is_no_trouble() {
        assert!(blobs(&[], 0).is_empty());
        assert!(blobs(&[0; 12], 4).is_empty());
        assert_eq!(blobs(&[7; 12], 4)[0].area, 12);
    }
}
